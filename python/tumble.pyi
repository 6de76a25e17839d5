"""Mass, centre of mass and inertia of free-flying robots, from their logs and in flight.

Units are SI. Quaternions are x y z w of world_from_body; a wrench is force, then torque about the body origin, in body axes, without gravity.
A row of NaN says that there was no measurement. What is refused is a `TumbleError`.
"""

from os import PathLike
from typing import Any, Literal, Protocol, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array = NDArray[np.float64]
_Path = Union[str, PathLike[str]]

__version__: str

class TumbleError(Exception):
    """`code` is explained in docs/errors.md, `remedy` says what to do, `message` what is wrong."""

    code: str
    message: str
    remedy: str

class _Estimator(Protocol):
    """An estimator of one's own; its attribute `name`, or else the name of its class, is the method's."""

    def estimate(self, problem: Problem) -> tuple[ArrayLike, ArrayLike]:
        """The ten parameters, and their covariance (10, 10)."""

class Problem:
    """What an estimator is told: equations `regressor @ parameters = wrench`, and the record that they are of."""

    @property
    def t(self) -> _Array:
        """Time of each equation, s."""
    @property
    def regressor(self) -> _Array:
        """(N, 6, 10): rows force x y z and torque x y z; columns as `Identification.parameters`."""
    @property
    def wrench(self) -> _Array:
        """(N, 6): force, then torque."""
    @property
    def rows_alike(self) -> float:
        """Of how many neighbours the samples of one equation are shared: by so much its covariance is too small."""
    @property
    def magnitudes(self) -> _Array:
        """Size of each parameter for a body of the size that the record shows."""
    @property
    def record(self) -> dict[str, _Array]:
        """`t`, `position`, `quaternion`, `rate`, `velocity`, `acceleration`, `wrench`, as `identify` takes them."""

class Sigma:
    """One standard deviation of each quantity; NaN where the log does not determine it."""

    @property
    def mass(self) -> float: ...
    @property
    def center_of_mass(self) -> _Array: ...
    @property
    def inertia(self) -> _Array: ...

class Identification:
    """What a log says of the body. Numbers that it does not determine are NaN, and `not_determined` says so in words."""

    @property
    def mass(self) -> float: ...
    @property
    def center_of_mass(self) -> _Array: ...
    @property
    def inertia(self) -> _Array:
        """About the centre of mass, body axes; off the diagonal minus the products of inertia."""
    @property
    def sigma(self) -> Sigma | None: ...
    @property
    def parameters(self) -> _Array | None:
        """Mass, first moments x y z, inertia about the body origin xx xy xz yy yz zz."""
    @property
    def covariance(self) -> _Array | None:
        """Of `parameters`, (10, 10)."""
    @property
    def verdict(self) -> Literal["identified", "doubtful", "not-determined", "no-body-explains"]: ...
    @property
    def identified(self) -> bool:
        """Whether the numbers may be used."""
    @property
    def not_determined(self) -> list[str]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def method(self) -> str: ...
    @property
    def residuals(self) -> dict[str, _Array]:
        """`t`, `force`, `torque`: what the body leaves unexplained."""
    def to_dict(self) -> dict[str, Any]:
        """The object that `tumble identify --json` prints; docs/identify-json.md."""
    def to_json(self) -> str: ...
    def table(self) -> str:
        """The table that `tumble identify` prints."""
    def export(self, path: _Path, *, force: bool = False) -> None:
        """Writes the body to a new file: .toml, .json, .urdf or .xml (MJCF)."""
    def plot(self) -> Any:
        """A matplotlib figure of estimates and residuals."""

class Run:
    """What a command gave: its summary, its series, and the files that it wrote to a temporary folder."""

    @property
    def summary(self) -> dict[str, Any]: ...
    @property
    def achieved(self) -> bool: ...
    @property
    def messages(self) -> list[str]: ...
    @property
    def series(self) -> dict[str, _Array]: ...
    @property
    def files(self) -> list[str]: ...
    def table(self, name: str) -> dict[str, _Array]:
        """The columns of one of the `files`, such as "motion.csv"."""
    def report(self, path: _Path, *, force: bool = False) -> None:
        """Writes the page of the flight to a new file."""
    def save(self, name: str, path: _Path, *, force: bool = False) -> None:
        """Writes one of the `files` to a new file."""

class Belief:
    """What is believed of the body."""

    @property
    def mass(self) -> float: ...
    @property
    def center_of_mass(self) -> _Array: ...
    @property
    def inertia(self) -> _Array: ...
    @property
    def sigma(self) -> Sigma: ...
    @property
    def parameters(self) -> _Array: ...
    @property
    def covariance(self) -> _Array: ...

class Reception:
    """What was made of a measurement."""

    @property
    def kind(self) -> str:
        """ "used", "gated", "relocalised", "frozen", "too-old", "duplicate", "from-the-future" or "malformed"."""
    @property
    def nis(self) -> float | None: ...
    @property
    def reason(self) -> str | None: ...

class FlightEstimator:
    """Motion and body of a free flyer, step by step: say what `acted`, hand over what was `measured`, ask for `belief` and `state`."""

    def __init__(
        self,
        parameters: ArrayLike,
        covariance: ArrayLike,
        *,
        t: float = 0.0,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        rate: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        attitude_noise: float = 1e-3,
        position_noise: float = 1e-3,
        rate_noise: float = 1e-3,
        velocity_noise: float = 1e-3,
        torque_noise: float = 1e-4,
        force_noise: float = 1e-3,
        period: float = 0.016,
        planar: bool = False,
    ) -> None: ...
    def acted(self, since: float, until: float, wrench: ArrayLike, *, stored_momentum: ArrayLike | None = None) -> None: ...
    def measured(
        self,
        t: float,
        *,
        position: ArrayLike | None = None,
        quaternion: ArrayLike | None = None,
        rate: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
    ) -> Reception: ...
    def belief(self) -> Belief: ...
    def state(self, t: float) -> dict[str, _Array]: ...
    @property
    def health(self) -> dict[str, Any]: ...
    @property
    def counts(self) -> dict[str, int]: ...
    def doubt_body(self) -> None: ...
    def doubt_wrench(self) -> None: ...
    def restart(self, parameters: ArrayLike, covariance: ArrayLike) -> None: ...

def parameters(mass: float, center_of_mass: ArrayLike, inertia: ArrayLike) -> _Array:
    """The ten numbers of a body, of its mass, centre of mass and inertia about it."""

def identify(
    t: ArrayLike,
    position: ArrayLike,
    quaternion: ArrayLike,
    wrench: ArrayLike,
    *,
    rate: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    stored_momentum: ArrayLike | None = None,
    method: str | None = None,
    wrench_timing: Literal["held", "sampled"] | None = None,
    gravity: Sequence[float] | None = None,
    estimate: Sequence[str] | None = None,
    prior: _Path | None = None,
    planar: bool | None = None,
    sensing: _Path | None = None,
    reference: _Path | None = None,
    holdout: float | None = None,
    estimator: _Estimator | None = None,
) -> Identification:
    """The body that explains a motion, from arrays of one row per time: s as floats, or ns as integers."""

def identify_file(
    path: _Path,
    *,
    method: str | None = None,
    wrench_timing: Literal["held", "sampled"] | None = None,
    gravity: Sequence[float] | None = None,
    estimate: Sequence[str] | None = None,
    prior: _Path | None = None,
    planar: bool | None = None,
    sensing: _Path | None = None,
    actuators: _Path | None = None,
    reference: _Path | None = None,
    holdout: float | None = None,
    reorder: bool = False,
    robot: str | None = None,
    estimator: _Estimator | None = None,
) -> Identification:
    """The body that explains a log, as `tumble identify LOG` reads it."""

def simulate(
    scenario: _Path, *, seed: int | None = None, duration: float | None = None, sensing: _Path | None = None
) -> Run:
    """Flies a scenario, as `tumble simulate`: `series` are the columns of its log."""

def fly(
    scenario: _Path | None = None,
    *,
    seed: int | None = None,
    fault: str | None = None,
    sensing: _Path | None = None,
    weighting: str | None = None,
    feedback: bool = True,
    model: str | None = None,
    draw: bool = False,
) -> Run:
    """Flies a mission, as `tumble fly`; `report(path)` writes its page."""

def plan(
    scenario: _Path,
    *,
    seed: int | None = None,
    objective: Literal["duration", "impulse"] | None = None,
    planner: str | None = None,
    budget: int | None = None,
    time_limit: float | None = None,
    obstacle_set: int | None = None,
    first: bool = False,
    local: bool = False,
    weighting: str | None = None,
    criterion: str | None = None,
    unknowns: str | None = None,
    steps: int | None = None,
) -> Run:
    """A way from start to goal, as `tumble plan`; with `local` the first seconds of it in detail."""

def excite(
    *,
    period: float | None = None,
    harmonics: int | None = None,
    criterion: Literal["v1", "d", "a", "e", "condition"] | None = None,
    starts: int | None = None,
    seed: int | None = None,
    rate: float | None = None,
    cycles: int | None = None,
    position: Sequence[float] | None = None,
    angle: float | None = None,
    speed: float | None = None,
    angular_rate: float | None = None,
    acceleration: float | None = None,
    angular_acceleration: float | None = None,
    planar: bool = False,
    body: _Path | None = None,
    force_limit: float | None = None,
    torque_limit: float | None = None,
    saturate: bool = False,
    position_noise: float | None = None,
    attitude_noise: float | None = None,
    force_noise: float | None = None,
    torque_noise: float | None = None,
    fly: bool = False,
    payload: _Path | None = None,
) -> Run:
    """A periodic motion that shows all ten parameters, as `tumble excite`; with `fly` its simulated flight."""

def sample(
    kind: Literal["log", "bag", "wrenches"], folder: _Path, *, seed: int | None = None, force: bool = False
) -> str:
    """Writes files to try the other functions with, as `tumble sample`; says what it wrote."""
