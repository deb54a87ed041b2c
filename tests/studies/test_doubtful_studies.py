"""Studies that cannot be right, or of which little can be said."""

import numpy as np
import pytest

from skthermo.detection import MahalanobisDetector
from skthermo.studies import Scenario, compare_extensions, sweep
from tests.studies.studies import LATER, WEATHER, YEAR, study_of, windowed


def study(fem, scenarios, **options):
    return study_of(fem, MahalanobisDetector(), scenarios, **options)


def test_one_repeat_has_no_band(fem):
    results = study(fem, [Scenario("healthy")], n_repeats=1).run(WEATHER)
    assert results[["pi_low", "pi_high"]].isna().all(axis=None)


def test_a_baseline_in_other_units_gives_false_alarms_that_are_said(fem):
    wrong = study(fem, [Scenario("healthy")])
    with pytest.warns(UserWarning, match="100% .*'healthy'.*many-false-alarms"):
        wrong.run(WEATHER, YEAR.frequencies * 2 * np.pi)
    assert any("many-false-alarms" in text for text in wrong.warnings_)


@pytest.mark.parametrize("is_named", [False, True])
def test_weather_by_a_longer_step_than_the_baselines_leaves_windows_without_values(fem, is_named):
    thinned = WEATHER[:30] if is_named else LATER.temperatures[:2]
    with pytest.raises(ValueError, match=r"none of .* can be evaluated") as raised:
        study_of(fem, windowed("5D"), [Scenario("healthy")], n_repeats=1).run(thinned)
    assert ("every 3 days, records of the baseline every 1 day" in str(raised.value)) == is_named


def test_a_family_that_is_not_found_leaves_the_others_their_curves(fem):
    both = study(fem, [*sweep(fem, (0.1, 0.2, 0.3), ["bottom"]), *sweep(fem, (0.001, 0.002), ["vertical"])[1:]])
    both.run(WEATHER)
    assert [both.is_undetected(family) for family in ("bottom", "vertical")] == [False, True]
    with pytest.warns(UserWarning, match="'vertical'.*outliers.*no-curve"):
        curve = both.minimum_detectable_damage(method="curve")
    assert 0.1 < curve.loc[("bottom", "simulated"), "mdd"] < 0.3
    unknown = curve.loc[("vertical", "simulated")]
    assert (np.isnan(unknown["mdd"]), unknown["ci_low"], np.isnan(unknown["ci_high"])) == (True, 0.002, True)
    table = compare_extensions(both, WEATHER, modes=[], baseline_factors=(2,)).set_index("family")
    assert np.isfinite(table["gain"]["bottom"])
    assert np.isnan(table["gain"]["vertical"])


def test_a_blind_detector_is_said_to_be_blind(fem):
    blind = study(fem, sweep(fem, (0.05, 0.1), ["bottom"]))
    results = blind.run(WEATHER)
    for rate in (results["rate"][0], 0.0):
        results["rate"] = rate
        with pytest.warns(UserWarning, match="outliers of the baseline raise the threshold.*no-curve") as caught:
            minimum = blind.minimum_detectable_damage(method="curve")
        assert len(caught) == 1
        assert minimum["mdd"].isna().all()


def test_errors_name_the_family_with_damage_and_strengthening(fem):
    mixed = study(fem, [Scenario(f"bottom {severity}", {"bottom": severity}) for severity in (-0.1, 0.2)])
    mixed.run(WEATHER)
    for ask in (mixed.minimum_detectable_damage, lambda: mixed.pod_curve("bottom")):
        with pytest.raises(ValueError, match=r"family 'bottom': severities are \[-0.1, 0.2\]"):
            ask()


def test_a_sweep_of_damage_and_strengthening_has_a_curve_for_each(fem):
    both = study(fem, sweep(fem, (-0.3, -0.2, -0.1, 0.1, 0.2, 0.3), ["bottom"]))
    both.run(WEATHER)
    alone = study(fem, sweep(fem, (0.1, 0.2, 0.3), ["bottom"]))
    alone.run(WEATHER)
    for method in ("grid", "curve"):
        found = both.minimum_detectable_damage(method=method)["mdd"].droplevel("source")
        assert found.index.tolist() == ["bottom strengthened", "bottom"]
        assert -0.4 < found["bottom strengthened"] < 0 < found["bottom"] < 0.4
        assert found["bottom"] == pytest.approx(alone.minimum_detectable_damage(method=method)["mdd"].iloc[0])
