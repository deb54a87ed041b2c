"""What an identification says: one wording, whose first sentence follows the probabilities."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from skthermo.datasets import make_truss_campaign
from skthermo.plotting import IdentifiedDamageDisplay
from skthermo.reporting._html import Html
from skthermo.reporting._identified import identified_damage
from skthermo.studies import identify_damage

plt = pytest.importorskip("matplotlib.pyplot")
plt.switch_backend("Agg")
GROUPS = ["bottom", "top", "diagonal"]
FEW = {"n_independent": 1.6, "n_trained_independent": 12.2}


@pytest.fixture(scope="module")
def found(fem):
    later = make_truss_campaign(damage={"top": 0.2}, random_state=1)
    return identify_damage(fem, later.temperatures[:60], later.frequencies[:60], GROUPS, random_state=0)


def changed(found, is_evident, is_known, is_misfit, is_few):
    table = found.table.assign(significant=is_known & np.array([False, True, False]))
    numbers = {"n_independent": 60.0, "n_trained_independent": 365.0} | (FEW if is_few else {})
    return replace(
        found,
        table=table,
        p_value=0.002 if is_evident else 0.35,
        misfit_p_value=0.01 if is_misfit else 0.6,
        records=replace(found.records, **numbers),
    )


CASES = [case for case in itertools.product([True, False], repeat=4) if case[0] or not case[1]]


@pytest.mark.parametrize(("is_evident", "is_known", "is_misfit", "is_few"), CASES)
def test_report_summary_and_drawing_say_the_same(found, is_evident, is_known, is_misfit, is_few):
    case = changed(found, is_evident, is_known, is_misfit, is_few)
    first, *others = case.answer()
    said = " ".join(others)
    if is_evident:
        assert first.startswith("Something has changed (probability by chance 0.002)")
        assert ("does not explain all of it (probability of such a misfit by chance 0.01)" in first) == is_misfit
    elif is_misfit:
        assert first == (
            "Something has changed, but no damage of these groups explains it (probability by chance 0.01)."
        )
    else:
        assert first == "No change is evident (probability by chance 0.35)."
    assert ("Which part cannot be said" in said) == (is_evident and not is_known)
    assert ("could have gone unseen" in said) == (not is_evident and not is_misfit)
    assert ("top has lost" in said or "whether top is damaged" in said) == is_known
    assert ("doubtful" in said or "if nothing else" in said) == (is_known and is_misfit)
    summary = case.summary()
    page = identified_damage(case)
    assert isinstance(page, Html)
    for sentence in (first, *others, *case.limits(), *case.records.sentences()):
        assert sentence.replace("\xa0", " ") in summary
        assert sentence in page
    display = IdentifiedDamageDisplay.from_predictions(case)
    assert " ".join(display.figure_.get_suptitle().split()) == first.replace("\xa0", " ")
    plt.close(display.figure_)
    assert ("60 records, worth 1.6 independent ones" in summary) == is_few
    kinds = dict(case.warnings())
    assert ("few independent records" in kinds) == is_few
    assert ("few independent training records" in kinds) == is_few
    assert ("unexplained shifts" in kinds) == is_misfit


def test_no_group_is_called_damaged_where_no_damage_is_evident(found):
    case = replace(found, p_value=0.2, table=found.table.assign(significant=False))
    assert (case.damaged == "no").all()
    text = case.summary()
    assert text.startswith("No change is evident (probability by chance 0.2).")
    highest = found.table.loc["top", "severity"] + 2 * found.table.loc["top", "standard_error"]
    assert f"{100 * highest:.1f} % in top" in text


def test_records_that_were_left_out_or_scatter_widely_are_told(found):
    records = replace(
        found.records, n_given=90, left_out={"without a frequency": 12, "in foreign weather": 3}, wider={"f3": 2.4}
    )
    case = replace(found, records=records)
    assert records.n_compared == 75
    assert "15 of 90 records could not be compared: 12 without a frequency and 3 in foreign weather." in case.summary()
    assert "Mode f3 scatters 2.4 times as widely as in the training records" in case.summary()
    assert "records that were not compared" in dict(case.warnings())


@pytest.mark.filterwarnings("ignore")
def test_records_with_outliers_widen_their_own_errors(fem):
    later = make_truss_campaign(random_state=1)
    T, F = later.temperatures[:60], later.frequencies[:60].copy()
    plain = identify_damage(fem, T, F, GROUPS, random_state=0)
    F.iloc[::7, 2] *= 0.9
    spoiled = identify_damage(fem, T, F, GROUPS, random_state=0)
    assert list(spoiled.records.wider) == ["f3"]
    assert plain.records.wider == {}
    ratio = spoiled.shifts["standard_error"] / plain.shifts["standard_error"]
    assert ratio["f3"] > 1.5
    assert ratio.drop("f3").max() < 1.1
