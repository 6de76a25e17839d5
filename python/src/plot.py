"""The figure of an identification."""

import numpy as np


def plot(found):
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplot_mosaic([["mass", "center", "inertia"], ["force"] * 3, ["torque"] * 3])
    sigma = found.sigma
    axes["mass"].set(title="mass", ylabel="kg")
    axes["center"].set(title="centre of mass", ylabel="m")
    axes["inertia"].set(title="inertia about it", ylabel="kg m²")
    if sigma is not None:
        places = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])
        bars = [
            ("mass", ["m"], [found.mass], [sigma.mass]),
            ("center", ["x", "y", "z"], found.center_of_mass, sigma.center_of_mass),
            ("inertia", ["xx", "yy", "zz", "xy", "xz", "yz"], found.inertia[places], sigma.inertia[places]),
        ]
        for name, labels, values, deviations in bars:
            places_x = np.arange(len(labels))
            axes[name].errorbar(places_x, values, yerr=2 * np.asarray(deviations), fmt="o", capsize=4)
            axes[name].set_xticks(places_x, labels)
    residuals = found.residuals
    since = residuals["t"] - residuals["t"][:1]
    for name, unit in [("force", "N"), ("torque", "N m")]:
        for axis in range(3):
            axes[name].plot(since, residuals[name][:, axis], label="xyz"[axis], linewidth=0.8)
        axes[name].set(title=f"{name} that the body leaves unexplained", ylabel=unit)
        axes[name].legend(loc="upper right")
    axes["torque"].set_xlabel("time since the start, s")
    figure.suptitle(f"{found.verdict} by {found.method}; bars: two standard deviations to either side")
    return figure
