"""The first figures of README and the site, light and dark: first_picture.py FOLDER, such as docs/figures."""

import sys
from collections.abc import Mapping
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from friction_fmus import fmu
from friction_fmus.harness import Result, System

EXAMPLES = Path(__file__).parents[1] / "examples"
SCHEMES = {  # suffix of the file -> text, grid, the lines before and after
    "": ("#333333", "#dddddd", "#D55E00", "#0072B2"),
    "-dark": ("#d5d7e0", "#4a4d5c", "#FF9D5C", "#6CB8F0"),
}
LEVELS = {"friction.sigma0": 0.9e5, "friction.Fc": 0.9, "friction.Fs": 1.35}
"""Forces of a real contact that are 10 % below those of the feedforward, with the same presliding displacement."""


def main() -> None:
    """Run the two examples and draw them."""
    folder = Path(sys.argv[1])
    stick_slip = run("stick_slip.toml")
    higher = run("stick_slip.toml", {"friction.Fs": 2.0})
    alone = run("compensated_axis.toml", LEVELS | {"friction_model.gain": 0.0})
    compensated = run("compensated_axis.toml", LEVELS)
    for suffix, (text, grid, before, after) in SCHEMES.items():
        figure, (motion, error) = panels(
            (9.0, 3.2), text, grid, ("Simulate: a spring pulls a mass", "Compensate: an axis follows a sine")
        )
        time = stick_slip["time"]
        motion.plot(time, 0.1 * time, color=text, lw=1.0, ls="--")
        motion.text(11.0, 1.42, "end of the spring", color=text, fontsize=9, rotation=32.0, ha="center")
        motion.plot(time, stick_slip["mass.x"], color=after, lw=1.8)
        motion.text(14.2, 0.55, "mass: it sticks and slips", color=after, fontsize=9)
        motion.set(xlabel="time [s]", ylabel="position [m]")
        for result, colour, label in ((alone, before, "feedback only"), (compensated, after, "with LuGre feedforward")):
            shown = result.sel(time=slice(1.0, None))
            error.plot(
                shown["time"] - 1.0, 1e6 * (shown["reference.r"] - shown["axis.x"]), color=colour, lw=1.8, label=label
            )
        error.set(xlabel="time [s]", ylabel="tracking error [µm]", ylim=(-20.0, 24.0), xticks=[0, 1, 2])
        error.legend(loc="upper right", fontsize=8, frameon=False, labelcolor=text, ncols=2)
        save(figure, folder / f"first_result{suffix}.png")

        figure, axes = panels((5.4, 2.7), text, grid, ("Position of the mass",))
        axes[0].plot(time, stick_slip["mass.x"], color=after, lw=1.8)
        axes[0].set(xlabel="time [s]", ylabel="position [m]", ylim=(-0.1, 2.6))
        save(figure, folder / f"stick_slip_run{suffix}.png")

        figure, axes = panels((5.4, 2.7), text, grid, ("Position of the mass",))
        for result, colour, label in ((stick_slip, after, "Fs = 1.5 N"), (higher, before, "Fs = 2 N")):
            axes[0].plot(time, result["mass.x"], color=colour, lw=1.8, label=label)
        axes[0].set(xlabel="time [s]", ylabel="position [m]", ylim=(-0.1, 2.6))
        axes[0].legend(loc="upper left", fontsize=9, frameon=False, labelcolor=text)
        save(figure, folder / f"stick_slip_higher{suffix}.png")


def run(name: str, start: Mapping[str, float] | None = None) -> Result:
    """Run an example with other start values."""
    with System.from_toml(EXAMPLES / name, resolve=fmu) as system:
        return system.with_start(start or {}).run(record=["*"])


def panels(size: tuple[float, float], text: str, grid: str, titles: tuple[str, ...]) -> tuple[Figure, list[Axes]]:
    """Return a transparent figure with panels."""
    figure = Figure(figsize=size, layout="constrained")
    axes = list(figure.subplots(1, len(titles), squeeze=False)[0])
    for axis, title in zip(axes, titles, strict=True):
        axis.set_title(title, fontsize=11, color=text, loc="left")
        axis.grid(color=grid, lw=0.6)
        axis.tick_params(colors=text, labelsize=9, length=0)
        axis.xaxis.label.set_color(text)
        axis.yaxis.label.set_color(text)
        for side in axis.spines.values():
            side.set_visible(False)
        axis.patch.set_alpha(0.0)
    return figure, axes


def save(figure: Figure, path: Path) -> None:
    """Write a figure without a background."""
    figure.savefig(path, dpi=120, transparent=True)


if __name__ == "__main__":
    main()
