"""Writes the reference recordings of `tests/recordings.rs` and the values they hold.

Not needed to build or test. Needs Python 3.11 with `pip install rosbags==0.11.9 numpy lz4`; run as

    python bags.py FOLDER

with FOLDER = `crates/astrobee/tests/golden`. The encoder is that of rosbags (Apache-2.0), which shares nothing with ours;
the definitions below are the field lists of nasa/astrobee 0.19.1 (and its older FlightMode), and the md5 sums that rosbags
computes from them are written beside the values, so that they check the sums that we list.
"""
import json
import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

FLIGHT_MODE = """
uint8 SPEED_MIN=0
uint8 SPEED_OFF=0
uint8 SPEED_QUIET=1
uint8 SPEED_NOMINAL=2
uint8 SPEED_AGGRESSIVE=3
uint8 SPEED_MAX=3
std_msgs/Header header
string name
bool control_enabled
{}
float32 tolerance_pos
float32 tolerance_vel
float32 tolerance_att
float32 tolerance_omega
float32 tolerance_time
geometry_msgs/Vector3 att_kp
geometry_msgs/Vector3 att_ki
geometry_msgs/Vector3 omega_kd
geometry_msgs/Vector3 pos_kp
geometry_msgs/Vector3 pos_ki
geometry_msgs/Vector3 vel_kd
float32 hard_limit_vel
float32 hard_limit_accel
float32 hard_limit_omega
float32 hard_limit_alpha
uint8 speed
"""
DEFINITIONS = {
    "ff_msgs/EkfState": """
std_msgs/Header header
string child_frame_id
geometry_msgs/Pose pose
geometry_msgs/Vector3 velocity
geometry_msgs/Vector3 omega
geometry_msgs/Vector3 gyro_bias
geometry_msgs/Vector3 accel
geometry_msgs/Vector3 accel_bias
float32[15] cov_diag
uint8 confidence
uint8 CONFIDENCE_GOOD=0
uint8 CONFIDENCE_POOR=1
uint8 CONFIDENCE_LOST=2
uint8 aug_state_enum
uint8 status
uint8 STATUS_INVALID=255
uint8 of_count
uint8 ml_count
geometry_msgs/Pose hr_global_pose
float32[50] ml_mahal_dists
bool estimating_bias
""",
    "ff_msgs/FamCommand": """
std_msgs/Header header
geometry_msgs/Wrench wrench
geometry_msgs/Vector3 accel
geometry_msgs/Vector3 alpha
uint8 status
geometry_msgs/Vector3 position_error
geometry_msgs/Vector3 position_error_integrated
geometry_msgs/Vector3 attitude_error
geometry_msgs/Vector3 attitude_error_integrated
float32 attitude_error_mag
uint8 control_mode
""",
    "ff_hw_msgs/PmcGoal": "uint8 motor_speed\nuint8[6] nozzle_positions\n",
    "ff_hw_msgs/PmcCommand": "std_msgs/Header header\nff_hw_msgs/PmcGoal[] goals\n",
    "ff_hw_msgs/PmcStatus": """
uint8 motor_speed
uint8 motor_current
uint8 v6_current
uint16 pressure
uint8[] temperatures
uint8 status_1
uint8 status_2
uint8 command_id
""",
    "ff_hw_msgs/PmcTelemetry": "std_msgs/Header header\nff_hw_msgs/PmcStatus[] statuses\n",
}
MODES = {
    "v0.15.1": "float32 collision_radius",
    "v0.16.2": "float32 collision_radius\nfloat32 tolerance_pos_endpoint",
    "v0.16.3": "float32 tolerance_pos_endpoint",
}


def store(base, mode):
    """Types of a ROS version with Astrobee's, one FlightMode among them."""
    types = get_typestore(base)
    wanted = DEFINITIONS | {"ff_msgs/FlightMode": FLIGHT_MODE.format(MODES[mode])}
    if "geometry_msgs/msg/InertiaStamped" not in types.fielddefs:
        wanted["geometry_msgs/Inertia"] = (
            "float64 m\ngeometry_msgs/Vector3 com\nfloat64 ixx\nfloat64 ixy\nfloat64 ixz\nfloat64 iyy\nfloat64 iyz\nfloat64 izz\n"
        )
        wanted["geometry_msgs/InertiaStamped"] = "std_msgs/Header header\ngeometry_msgs/Inertia inertia\n"
    for name, text in wanted.items():
        package, message = name.split("/")
        types.register(get_types_from_msg(text, f"{package}/msg/{message}"))
    return types


class Maker:
    """Random messages, and their values one after the other in the order of the definition."""

    def __init__(self, types, seed, negative_seconds):
        self.types = types
        self.random = np.random.default_rng(seed)
        self.negative_seconds = negative_seconds

    def scalar(self, kind):
        random = self.random
        if kind == "bool":
            return bool(random.integers(2))
        if kind == "string":
            return ["", "body", "world", "cargo µ", "nominal"][random.integers(5)]
        if kind.startswith("float"):
            number = float(random.normal()) * 10.0 ** int(random.integers(-6, 6))
            return float(np.float32(number)) if kind == "float32" else number
        info = np.iinfo(kind)
        return int(random.integers(info.min, info.max, endpoint=True))

    def value(self, spec, values):
        node, detail = int(spec[0]), spec[1]
        if node == 1:  # base type: (name, string length)
            made = self.scalar(detail[0])
            # As text, since not every JSON library reads every float to its last bit.
            values.append(repr(made) if isinstance(made, float) else made)
            return made
        if node == 2:
            return self.message(detail, values)
        element, length = detail  # 3: fixed array, 4: sequence
        if node == 4:
            length = int(self.random.integers(0, 4))
            values.append(length)
        made = [self.value(element, values) for _ in range(min(length, 6))]
        # The rest of a long array in few digits, each with its own value: the files stay small.
        while len(made) < length:
            made.append(int(self.random.integers(-4000, 4000)) / 8)
            values.append(repr(made[-1]))
        if int(element[0]) == 1 and element[1][0] != "string":
            made = np.array(made, dtype=element[1][0])
        return made

    def message(self, name, values):
        if name == "builtin_interfaces/msg/Time":
            seconds = int(self.random.integers(-5 if self.negative_seconds else 0, 2**31 - 1))
            nanoseconds = int(self.random.integers(10**9))
            values.append(str(seconds * 10**9 + nanoseconds))
            return self.types.types[name](sec=seconds, nanosec=nanoseconds)
        made = {field: self.value(spec, values) for field, spec in self.types.fielddefs[name][1]}
        return self.types.types[name](**made)


TOPICS = [
    ("/bumble/gnc/ekf", "ff_msgs/EkfState", 1),
    ("/bumble/gnc/ctl/command", "ff_msgs/FamCommand", 1),
    ("/bumble/hw/pmc/command", "ff_hw_msgs/PmcCommand", 2),
    ("/bumble/hw/pmc/telemetry", "ff_hw_msgs/PmcTelemetry", 2),
    ("/bumble/hw/imu", "sensor_msgs/Imu", 1),
    ("/bumble/mob/inertia", "geometry_msgs/InertiaStamped", 1),
    ("/bumble/loc/pose", "geometry_msgs/PoseStamped", 1),
    ("/bumble/loc/twist", "geometry_msgs/TwistStamped", 1),
    ("/wrench", "geometry_msgs/WrenchStamped", 1),
    ("/odom", "nav_msgs/Odometry", 1),
    ("/rosout", "std_msgs/String", 1),
]


def dashed(name):
    package, message = name.split("/")
    return f"{package}/msg/{message}"


def bags(folder):
    """Three bags; every FlightMode under its own connection."""
    current = store(Stores.ROS1_NOETIC, "v0.16.3")
    maker = Maker(current, 5, negative_seconds=False)
    made = []
    for topic, name, count in TOPICS:
        _, md5 = current.generate_msgdef(dashed(name))
        for _ in range(count):
            values = []
            message = maker.message(dashed(name), values)
            made.append((topic, name, md5, bytes(current.serialize_ros1(message, dashed(name))), values))
    for mode in MODES:
        types = store(Stores.ROS1_NOETIC, mode)
        _, md5 = types.generate_msgdef("ff_msgs/msg/FlightMode")
        values = []
        message = Maker(types, 6, negative_seconds=False).message("ff_msgs/msg/FlightMode", values)
        payload = bytes(types.serialize_ros1(message, "ff_msgs/msg/FlightMode"))
        made.append(("/bumble/mob/flight_mode", "ff_msgs/FlightMode", md5, payload, values))
    # Neither by topic nor by time.
    order = np.random.default_rng(7).permutation(len(made))
    times = [1_600_000_000_000_000_000 + 16_000_000 * int(t) for t in np.random.default_rng(8).permutation(len(made))]
    expected = []
    for compression in ("none", "bz2", "lz4"):
        path = folder / f"messages_{compression}.bag"
        path.unlink(missing_ok=True)
        writer = Writer(path)
        if compression != "none":
            writer.set_compression(Writer.CompressionFormat[compression.upper()])
        writer.chunk_threshold = 2000 if compression == "none" else 500
        connections = {}
        with writer:
            # All in the plain bag, every fifth in the compressed ones.
            for index, time in list(zip(order, times))[:: 1 if compression == "none" else 5]:
                topic, name, md5, payload, values = made[index]
                if (topic, md5) not in connections:
                    # The definition's text is left out: it is not read, and long.
                    connections[topic, md5] = writer.add_connection(topic, dashed(name), msgdef=" ", md5sum=md5)
                writer.write(connections[topic, md5], time, payload)
                if compression == "none":
                    expected.append({"topic": topic, "type": name, "md5": md5, "log_time_ns": time, "values": values})
    write_lines(folder / "messages.jsonl", expected)


def cdr(folder):
    """Payloads of ROS 2, in either byte order."""
    types = store(Stores.ROS2_HUMBLE, "v0.16.3")
    maker = Maker(types, 9, negative_seconds=True)
    lines = []
    for number, (_, name, _) in enumerate(TOPICS[:-1] + [("", "ff_msgs/FlightMode", 1)]):
        for little in (True, False) if name.startswith("ff_hw") else (number % 2 == 0,):
            values = []
            message = maker.message(dashed(name), values)
            payload = bytes(types.serialize_cdr(message, dashed(name), little_endian=little)).hex()
            lines.append({"type": name, "payload": payload, "values": values})
    write_lines(folder / "messages_cdr.jsonl", lines)


def write_lines(path, lines):
    first = json.dumps({"provenance": "written by generate/bags.py with rosbags 0.11.9 (Apache-2.0): values put in, payloads encoded by it"})
    path.write_text("\n".join([first] + [json.dumps(line, ensure_ascii=False, separators=(",", ":")) for line in lines]) + "\n")


if __name__ == "__main__":
    bags(Path(sys.argv[1]))
    cdr(Path(sys.argv[1]))
