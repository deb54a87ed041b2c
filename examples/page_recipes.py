"""What every example does where it is run as a script: it reads options and saves its figures."""

import argparse
import sys
from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.figure import Figure


def command_line() -> argparse.ArgumentParser:
    """Parser with the option that every example has."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figures")
    return parser


def print_table(title: str, table: object, *lines: str) -> None:
    """Print a table or a text under its title, and lines that say what its columns are."""
    print("", title, "-" * len(title), table, *lines, sep="\n")


def entitle(figure: Figure, title: str) -> None:
    """Give a figure a title; above its legend, where it has one outside its axes."""
    if figure.legends:
        figure.legends[0].set_title(title, {"size": "large"})
    else:
        figure.suptitle(title)


def save_figures(folder: Path) -> list[Path]:
    """Save all open figures, numbered, under the script's name; a gallery has shown and closed its figures before."""
    name = Path(sys.argv[0]).stem.removeprefix("plot_")
    paths = [folder / f"{name}_{number}.png" for number in range(1, len(plt.get_fignums()) + 1)]
    for path, number in zip(paths, plt.get_fignums(), strict=True):
        folder.mkdir(parents=True, exist_ok=True)
        plt.figure(number).savefig(path, dpi=130)
        print(path)
    return paths
