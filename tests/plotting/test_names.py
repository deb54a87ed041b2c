"""Names from data, and times of other zones, in displays."""

from io import BytesIO

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from skthermo.fem import Bar, Structure
from skthermo.plotting import DamageIndexDisplay, DetectorsDisplay, PODCurveDisplay, PredictionDisplay, StructureDisplay
from skthermo.studies import pod_curve

HOSTILE = "$E_{x$ & 50% <b>"
LONG = "a very long name of a damage group that somebody wrote, number 7"
TABLE = pd.DataFrame(np.linspace(4, 5, 20).reshape(10, 2), columns=[HOSTILE, LONG])


RATES = pd.DataFrame(
    [
        [name, HOSTILE, source, measure, 0.5, 0.4, 0.6]
        for name, measure in ((HOSTILE, "POD"), (LONG, "POD"))
        for source in ("simulated", "reference")
    ],
    columns=["detector", "scenario", "source", "measure", "rate", "pi_low", "pi_high"],
)
SHARES = ["false_alarms", "pod", "pod_deficit"]
RANKED = pd.DataFrame(0.5, [HOSTILE, LONG], [*SHARES, *(f"{n}_{end}" for n in SHARES for end in ("ci_low", "ci_high"))])
RANKED = RANKED.assign(pod_at_equal_pfa=0.5, within_limit=True, significantly_worse=False, not_evaluated=0.1, error="")
RANKED.loc[LONG, ["false_alarms", "error"]] = np.nan, HOSTILE


def structure():
    steel = {"E": 210e9, "A": 0.01, "density": 7850.0}
    ends = {0: "ab", 1: "bc", 2: "ca"}
    members = {name: Bar(*pair, **steel) for name, pair in ends.items()}
    return Structure(
        {"a": (0, 0), "b": (1, 0), "c": (0.5, 1)}, members, {"a": "xy", "b": "y"}, {HOSTILE: [0], LONG: [1]}
    )


@pytest.mark.nightly
@pytest.mark.parametrize(
    "draw",
    [
        lambda: PredictionDisplay.from_predictions(TABLE, {HOSTILE: TABLE, LONG: TABLE}, marks={HOSTILE: 3}),
        lambda: PredictionDisplay.from_predictions(TABLE, TABLE, labels=(HOSTILE, LONG), unit=HOSTILE),
        lambda: PredictionDisplay.from_predictions(TABLE, TABLE, temperature=TABLE[HOSTILE], labels=(HOSTILE, LONG)),
        lambda: DamageIndexDisplay.from_predictions({HOSTILE: {HOSTILE: TABLE[LONG]}, LONG: {LONG: TABLE[LONG]}}, 4.5),
        lambda: PODCurveDisplay.from_predictions(pod_curve([0.1, 0.2], [3, 17], [20, 20]), label=HOSTILE),
        lambda: PODCurveDisplay.from_predictions(pod_curve([0.1, 0.2], [3, 17], [20, 20]), label=2 * LONG),
        lambda: DetectorsDisplay.from_predictions(RATES, groups={HOSTILE: LONG, LONG: HOSTILE}),
        lambda: DetectorsDisplay.from_predictions(RANKED),
        lambda: StructureDisplay.from_structure(structure(), groups=[HOSTILE, LONG]),
        lambda: StructureDisplay.from_structure(structure(), {HOSTILE: 0.1}, label=HOSTILE),
    ],
)
def test_any_name_can_be_drawn_and_leaves_room_for_the_data(draw):
    figure = draw().figure_
    figure.savefig(BytesIO(), format="png")  # a warning of a layout that does not fit is an error
    width = sum(ax.get_position().width for ax in figure.axes[:3])
    assert width > (0.7 if len(figure.axes) == 3 else 0.3)
    plt.close(figure)


def test_the_onset_may_be_in_another_time_zone():
    index = pd.date_range("2024-07-01", periods=48, freq="h", tz="Europe/Berlin")
    onset = pd.Timestamp("2024-07-01 22:00", tz="UTC")
    display = DamageIndexDisplay.from_predictions(pd.Series(1.0, index), 2.0, onset=onset)
    line = next(line for line in display.ax_.lines if line.get_label() == "onset of damage")
    assert pd.Timestamp(line.get_xdata()[0]) == pd.Timestamp("2024-07-02")  # local time, as the records
    with pytest.raises(ValueError, match="soon"):
        DamageIndexDisplay.from_predictions(pd.Series(1.0, index), 2.0, onset="soon")
