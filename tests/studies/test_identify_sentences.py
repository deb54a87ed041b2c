"""What an identification says: the most probable explanation first, then what else could be and what is not known."""

import re
from html import escape

import numpy as np
import pytest

from tests.reporting.monitors import FakeMonitor
from tests.reporting.pages import page_text
from tests.studies.identified import ComparedRecords, identified

plt = pytest.importorskip("matplotlib.pyplot")
plt.switch_backend("Agg")

SPACE = "\N{NO-BREAK SPACE}"
CLEAR = {
    "side span": (0.85, {"side span": (0.12, 0.018)}),
    "main stays + bearings": (0.09, {"main stays": (0.04, 0.01), "bearings": (0.03, 0.01)}),
    "something else": (0.04, {}),
    "side span + something else": (0.019, {"side span": (0.1, 0.03)}),
    "no damage": (0.0002, {}),
}
PIERS = {
    "pier_1": (0.44, {"pier_1": (0.12, 0.018)}),
    "pier_2": (0.40, {"pier_2": (0.11, 0.018)}),
    "pier_1 + pier_2": (0.06, {"pier_1": (0.06, 0.03), "pier_2": (0.06, 0.03)}),
    "deck": (0.07, {"deck": (0.03, 0.01)}),
    "no damage": (0.03, {}),
}
HEALTHY = {
    "no damage": (0.9, {}),
    "vertical": (0.05, {"vertical": (0.3, 0.2)}),
    "something else": (0.03, {}),
    "deck": (0.02, {"deck": (0.02, 0.01)}),
}
ELSE = {"something else": (0.9, {}), "deck + something else": (0.06, {"deck": (0.02, 0.01)}), "no damage": (0.04, {})}
CASES = {
    "clear": identified(CLEAR),
    "alike": identified(PIERS, alike=[("pier_1", "pier_2")]),
    "healthy": identified(HEALTHY, groups=["deck", "piers", "vertical"], unobservable=["vertical"], p_value=0.4),
    "something else": identified(ELSE, groups=["deck", "piers"]),
}


def by_kind(found):
    return {warning.kind: str(warning) for warning in found.warnings()}


def said(found):
    return found.summary().split("\n")


def shifts(measured, explained=0.0, error=0.001):
    n_modes = len(measured)
    return {"measured": measured, "explained": [explained] * n_modes, "standard_error": [error] * n_modes}


def test_what_is_most_probable_what_else_could_be_and_whether_anything_has_changed():
    first, others, unchanged, averages, records = said(CASES["clear"])
    assert (
        first == "Most probable: a loss of 12 % of stiffness in side span (90 % interval 9 to 15 %), probability 85 %."
    )
    assert others == (
        "Less probable: about the same and something else (2 %); a loss of 4 % in main stays and of 3 % in bearings "
        "(9 %); something else than damage of these groups (4 %)."
    )
    assert unchanged == "Probability of no change: below 0.1 %."
    assert re.fullmatch(
        r"Averaged over all explanations: side span 1\d % "
        r"\(90 % interval 0 to 15 %; damaged with probability 8\d %\)\.",
        averages,
    )
    assert records == "60 records compared with 365 training records."


def test_what_only_adds_to_the_most_probable_explanation_is_reported_in_short():
    more = {
        "deck": (0.8, {"deck": (0.12, 0.012)}),
        "deck + piers": (0.05, {"deck": (0.11, 0.012), "piers": (0.014, 0.003)}),
        "deck + soil": (0.03, {"deck": (0.12, 0.012), "soil": (0.02, 0.003)}),
        "deck + something else": (0.04, {"deck": (0.12, 0.012)}),
        "deck + towers": (0.04, {"deck": (0.05, 0.012), "towers": (0.08, 0.012)}),  # much less in the deck
        "piers + soil": (0.04, {"piers": (0.05, 0.012), "soil": (0.08, 0.012)}),
    }
    assert said(identified(more))[1] == (
        "Less probable: about the same and 1.4 % in piers (5 %), something else (4 %) or 2.0 % in soil (3 %); a "
        "loss of 5 % in deck and of 8 % in towers (4 %); a loss of 5 % in piers and of 8 % in soil (4 %)."
    )


def test_an_explanation_that_is_sure_needs_no_averages():
    sure = identified({"top": (0.995, {"top": (0.2, 0.004)}), "bottom": (0.005, {"bottom": (0.2, 0.01)})})
    assert said(sure)[:2] == [
        "Most probable: a loss of 20.0 % of stiffness in top (90 % interval 19.3 to 20.7 %), probability 99.5 %.",
        "Probability of no change: below 0.1 %.",
    ]


def test_groups_that_look_alike_are_said_together_with_the_sum_of_their_probabilities():
    found = CASES["alike"]
    first, others, *_ = said(found)
    assert first == (
        "Most probable: a loss of 12 % of stiffness in pier_1 or pier_2 (90 % interval 9 to 15 %), which these modes "
        "cannot distinguish, probability 90 %."
    )
    assert others == "Less probable: a loss of 3 % in deck (7 %)."
    assert found.summary_table["probability"].to_dict() == pytest.approx(
        {"pier_1 or pier_2 12\xa0%": 0.9, "deck 3\xa0%": 0.07, "no damage": 0.03}
    )
    assert "pier_1 and pier_2 cannot be distinguished by these modes: only their common effect is known." in said(found)
    apart = identified(PIERS)
    assert apart.summary_table["probability"].iloc[0] == pytest.approx(0.44)


def test_groups_that_only_together_imitate_another_are_not_said_in_its_place():
    found = identified(PIERS, indistinguishable=[("pier_1", "pier_2", "deck")])
    assert found.summary_table["probability"].iloc[0] == pytest.approx(0.44)
    assert "pier_1, pier_2 and deck cannot be distinguished by these modes" in found.summary()


def test_silence_is_never_healthy():
    found = CASES["healthy"]
    first, others, unnoticed, unobservable, *_ = said(found)
    assert (
        first == "Most probable: no damage observable in these modes, probability 95 %."
    )  # with the unobservable one's
    assert others.startswith("Less probable: something else than damage of these groups (3 %); a loss of 2 % in deck")
    bounds = found.table["highest_if_damaged"]
    assert unnoticed == (
        f"95 % upper bounds on undetected losses of stiffness: {100 * bounds['deck']:.2g} % in deck and "
        f"{100 * bounds['piers']:.2g} % in piers."
    )
    assert unobservable == "Damage in vertical is unobservable in these modes."
    doubtful = identified(HEALTHY, unobservable=["vertical"], p_value=0.01)
    assert "However, such shifts are rare in a healthy structure (p value 0.01)." in said(doubtful)


def test_damage_of_a_group_that_is_hardly_seen_is_said_where_it_is_more_probable_than_none():
    severe = {"vertical": (0.97, {"vertical": (0.6, 0.15)}), "no damage": (0.03, {})}
    (first, *_) = said(identified(severe, unobservable=["vertical"]))
    assert first.startswith("Most probable: a loss of 60 % of stiffness in vertical")


@pytest.mark.parametrize(
    ("measured", "cause"),
    [
        ([-0.021, -0.02, -0.0195, -0.0205], "another clock of the logger, or mass or stiffness all over the structure"),
        ([0.02, -0.001, 0.012, 0.0], "strengthening, which was not sought (stiffening=...): 2 of 4 frequencies rose"),
        ([-0.001, -0.05, 0.001, 0.0], "another mode taken for mode f2, which alone departs"),
        ([-0.01, -0.05, 0.001, 0.0], "damage outside these groups, a change of mass or of a support, a wrong sensor"),
    ],
)
def test_where_no_damage_explains_the_shifts_likely_causes_are_named(measured, cause):
    found = identified(ELSE, groups=["deck", "piers"], shifts=shifts(measured))
    first, departs, causes, *_ = said(found)
    assert first == "Most probable: something else than damage of these groups, probability 90 %."
    worst = int(np.argmax(np.abs(measured)))
    assert departs == (
        f"No damage of these groups explains the shifts: mode f{worst + 1} has the largest residual, a measured shift "
        f"of {100 * measured[worst]:+.2f} % (standard error 0.10 %) and an explained one of +0.00 %."
    )
    assert causes.startswith(f"Likely causes: {cause}")
    assert cause in by_kind(found)["unexplained-shifts"]


@pytest.mark.parametrize(
    ("cause", "kind", "amount", "text"),
    [
        ("deck stiffer", "stiffening", -0.08, "a gain of 8 % of stiffness in deck (90 % interval 6 to 10 %)"),
        ("E lower", "parameter", -0.08, "a fall of 8 % in E (90 % interval 6 to 10 %)"),
        ("E higher", "parameter", 0.08, "a rise of 8 % in E (90 % interval 6 to 10 %)"),
        ("ballast", "mass", 0.8, "added mass of 80 % of ballast (90 % interval 78 to 82 %)"),
    ],
)
def test_other_causes_than_damage_are_said_by_what_they_change(cause, kind, amount, text):
    only = {cause: (0.97, {cause: (amount, 0.012)}), "something else": (0.03, {})}
    (first, *_) = said(identified(only, kinds={cause: kind}))
    assert first == f"Most probable: {text}, probability 97 %."


def test_strengthening_that_was_sought_is_not_named_as_a_cause():
    names = {"deck stiffer": "stiffening"}
    sought = identified(ELSE, groups=["deck", *names], kinds=names, shifts=shifts([0.02, -0.001, 0.012, 0.0]))
    assert "strengthening" not in sought.summary()


def test_what_the_most_probable_explanation_leaves_is_reported():
    found = identified(CLEAR, misfit_p_value=0.004, shifts=shifts([-0.02, -0.001, -0.012, 0.0], -0.001))
    (misfit,) = (line for line in said(found) if "does not explain" in line)
    assert misfit == (
        "The most probable explanation does not explain all of the shifts (p value 0.004): mode f1 has the largest "
        "residual, a measured shift of -2.00 % (standard error 0.10 %) and an explained one of -0.10 %."
    )
    assert "Likely causes: damage outside these groups" in by_kind(found)["unexplained-shifts"]
    assert "the fit explains any shift" in identified(CLEAR, misfit_p_value=np.nan).summary()


def test_explanations_that_are_not_listed_are_counted():
    few = {name: CLEAR[name] for name in ("side span", "something else")}
    assert "Explanations that are not listed have a probability of 11 % together." in said(identified(few))


@pytest.mark.one_case
@pytest.mark.parametrize("name", CASES)
def test_report_and_summary_say_the_same(name):
    found = CASES[name]
    page = page_text(FakeMonitor(), identified=found)
    for sentence in (*found.answer(), *found.limits(), *found.records.sentences()):
        assert sentence.replace(SPACE, " ") in found.summary()
        assert escape(sentence, quote=False) in page


def test_records_that_were_left_out_or_scatter_widely_are_reported():
    left_out = {"without a frequency": 12, "in foreign weather": 3}
    records = ComparedRecords(90, left_out, 75.0, 365, 365.0, {"f3": 2.4})
    found = identified(CLEAR, records=records)
    assert records.n_compared == 75
    assert "15 of 90 records could not be compared: 12 without a frequency and 3 in foreign weather." in found.summary()
    assert "Mode f3 scatters 2.4 times as widely as in the training records" in found.summary()
    assert "not-compared" in by_kind(found)


@pytest.mark.parametrize("is_few", [True, False])
def test_few_independent_records_are_warned_of(is_few):
    worth = (1.6, 12.2) if is_few else (60.0, 365.0)
    found = identified(CLEAR, records=ComparedRecords(60, {}, worth[0], 365, worth[1], {}))
    assert ("60 records (worth 1.6 independent ones)" in found.summary()) == is_few
    kinds = by_kind(found)
    assert ("few-independent-records" in kinds) == is_few


@pytest.mark.parametrize(
    ("amount", "kind", "is_at_bound"),
    [
        ((0.93, 0.02), "damage", True),
        ((0.85, 0.02), "damage", False),
        ((2.0, 0.05), "mass", False),  # twice the pattern
        ((0.97, 0.02), "parameter", False),
    ],
)
def test_only_a_severity_may_be_at_the_bound_of_severities(amount, kind, is_at_bound):
    found = identified({"deck": (1.0, {"deck": amount})}, kinds={"deck": kind})
    kinds = [warning.kind for warning in found.warnings()]
    assert ("severity-at-bound" in kinds) == is_at_bound


def test_parts_print_what_they_say():
    found = identified(PIERS, alike=[("pier_1", "pier_2")], unobservable=["deck"])
    for part in (found.separability, found.records):
        assert repr(part).split("\n") == list(part.sentences())
        assert all(sentence.replace(SPACE, " ") in found.summary() for sentence in part.sentences())
    assert f"misfit_p_value={found.probabilities.misfit_p_value:.2g}" in repr(found.probabilities)
