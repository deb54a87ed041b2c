"""The file of settings says what Python's API says, and mistakes in it are named with their line."""

import inspect
import re
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

import skthermo.detection
from skthermo.commands._proposal import toml
from skthermo.commands._settings import CLASSES, SECTIONS, class_named, read_settings, settings_of
from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import CompensatedDetector, DirectionalDetector, MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.preprocessing import ExponentialMeans, HingeFeatures
from skthermo.surrogate import DataInformedFEM
from tests.commands.folders import run

MODES = ["f1", "f2", "f3", "f4", "f5", "f6"]


@pytest.fixture(scope="module")
def proposed(fitted):
    return (fitted / "monitor.toml").read_text(encoding="utf-8")


@pytest.fixture
def read(tmp_path, proposed):
    """Settings after a change of the proposed ones."""

    def reading(old="", new=""):
        file = tmp_path / "monitor.toml"
        assert not old or proposed.count(old) == 1
        file.write_text(proposed.replace(old, new) if old else proposed + new, encoding="utf-8")
        return read_settings(file)

    return reading


def by_python(detector, *steps, compensator=None, **parameters):
    regression = make_pipeline(*steps) if len(steps) > 1 else steps[0]
    options = {"targets": MODES} | (compensator or {})
    detector = CompensatedDetector(detector, regression, **options)
    return Monitor(
        detector,
        **{"false_alarms_per_year": 1.0, "watch_per_year": 12.0, "units": "Hz", "random_state": 0} | parameters,
    )


@pytest.mark.parametrize("section", ["compensator", "monitor"])
def test_each_parameter_of_the_api_is_in_the_file_with_its_description(proposed, section):
    maker, without = SECTIONS[section][0](), SECTIONS[section][1]
    text = proposed.partition(f"\n[{section}]\n")[2].partition("\n\n")[0]
    shown = re.findall(r"^(?:# )?(\w+) = ", text, re.MULTILINE)
    assert shown == [name for name in inspect.signature(maker).parameters if name not in without]
    assert len(re.findall(r"^## [A-Z]", text, re.MULTILINE)) >= len(shown)


def test_each_section_describes_all_of_its_parameters():
    makers = [(maker(), without) for maker, without in SECTIONS.values()]
    makers += [(getattr(skthermo.detection, name), ()) for name in skthermo.detection.__all__]
    for maker, without in makers:
        if isinstance(maker, type) or inspect.isfunction(maker):
            assert not [name for name, one in settings_of(maker, without).items() if not one.text], maker


def test_the_file_makes_what_python_makes(read):
    assert repr(read().monitor()) == repr(by_python(DirectionalDetector(), HingeFeatures(), Ridge()))
    paper = read('class = "DirectionalDetector"', 'class = "MahalanobisDetector"').monitor()
    assert repr(paper) == repr(by_python(MahalanobisDetector(), HingeFeatures(), Ridge()))
    windowed = read("# window = ...", 'window = "5D"').monitor()
    assert windowed.detector.window == "5D"
    means = '[[features]]\nclass = "ExponentialMeans"\ntime_constants = ["2D", "20D"]\n\n[[features]]\nclass = "H'
    two = read('[[features]]\nclass = "H', means).monitor()
    assert repr(two) == repr(
        by_python(DirectionalDetector(), ExponentialMeans(["2D", "20D"]), HingeFeatures(), Ridge())
    )
    others = read('# regimes = "auto"', 'regimes = "none"').monitor()
    assert others.detector.regimes is None
    softening = read("# persistence = 3", 'persistence = 5\nmax_delay = "3D"').monitor()
    expected = by_python(DirectionalDetector(), HingeFeatures(), Ridge(), persistence=5, max_delay="3D")
    assert repr(softening) == repr(expected)
    assert clone(softening).get_params(deep=False).keys() == softening.get_params(deep=False).keys()


def test_directions_are_those_of_the_chain_where_there_is_one(read):
    year = make_truss_campaign(random_state=0)
    fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    assert read().monitor(fem).detector.detector.directions is fem
    given = read('# directions = "softening"', "directions = [[-1, 0, 0, 0, 0, 0]]").monitor(fem)
    assert given.detector.detector.directions == [[-1, 0, 0, 0, 0, 0]]
    paper = read('class = "DirectionalDetector"', 'class = "MahalanobisDetector"')
    assert isinstance(paper.monitor(fem).detector.detector, MahalanobisDetector)


def test_defaults_that_the_file_shows_are_those_that_hold(proposed, read, tmp_path):
    lines = [re.sub(r"^# (\w+ = (?!\.\.\.))", r"\1", line) for line in proposed.partition("# [fem]")[0].splitlines()]
    file = tmp_path / "all.toml"
    file.write_text("\n".join(lines), encoding="utf-8")
    shown, default = read_settings(file), read()
    assert repr(shown.monitor()) == repr(default.monitor())
    for part in ("files", "records", "csv"):
        one, other = (vars(getattr(found, part)) for found in (shown, default))
        assert {k: v for k, v in one.items() if v} == {k: v for k, v in other.items() if v}


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("# persistence = 3", "persistance = 3", "did you mean 'persistence'"),
        ("[monitor]\n", "[montior]\n", "did you mean 'monitor'"),
        ("# persistence = 3", "persistence = 0", "persistence"),
        ("# persistence = 3", 'persistence = "three"', "persistence"),
        ("# persistence = 3", "persistence = -1", "persistence"),
        ("false_alarms_per_year = 1.0", "false_alarms_per_year = -1", "false_alarms_per_year"),
        ('class = "DirectionalDetector"', 'class = "MahalanobisDetecter"', "did you mean 'MahalanobisDetector'"),
        ('class = "sklearn.linear_model.Ridge"', 'class = "sklearn.linear_model.Rigde"', "scikit-learn"),
        ('class = "sklearn.linear_model.Ridge"', 'class = "os.system"', "scikit-learn"),
        ('class = "sklearn.linear_model.Ridge"', "alpha = 2", "class"),
        ("# n_knots = 4", "n_knots = -4", "n_knots"),
        ('# separator = ","', "separator = 3", "expected str"),
        ('# stamps = "ISO8601"', "stamps = true", "expected str"),
        ("# time_zone = ...", 'time_zone = "Europe/Brussel"', "Europe/Brussels"),
        ("# missing = []", 'missing = ["x"]', "list of float"),
        ('temperatures = ["T1", "T2", "T3"]', 'temperatures = "T1"', "list of str"),
        ('temperatures = ["T1", "T2", "T3"]', 'temperatures = ["T1", "T2", "f1"]', "f1"),
        ('temperatures = ["T1", "T2", "T3"]', "temperatures = []", "temperatures"),
        ('temperatures = ["T1", "T2", "T3"]', "", "lacks temperatures"),
        ("# convert = {}", 'convert = {T1 = "R"}', "convert"),
        ("[compensator]\n", '[compensator]\nestimator = "Ridge"\n', "estimator"),
        ("[[features]]", "[features]", "[[features]]"),
        ("[regression]", "[[regression]]", "[regression], once"),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_their_line(read, proposed, old, new, expected):
    with pytest.raises(ValueError, match=r"monitor\.toml") as failed:
        read(old, new)
    assert expected in str(failed.value)
    first = proposed[: proposed.index(old)].count("\n") + 1
    line = int(re.search(r"line (\d+)", str(failed.value))[1])
    wrong = new.strip().split("\n")[-1] if new else ""
    changed = proposed.replace(old, new).splitlines()
    assert line == first or changed[line - 1].startswith("[") or changed[line - 1] == wrong


def test_what_is_no_toml_and_no_file_is_an_error(read, tmp_path):
    with pytest.raises(ValueError, match="line"):
        read(new="\nname = \n")
    with pytest.raises(FileNotFoundError, match="init"):
        read_settings(tmp_path / "no.toml")
    done = run("status", tmp_path / "no.toml", "--json")
    assert (done.code, len(done.json["bridges"][0]["errors"])) == (3, 1)


def test_classes_come_from_skthermo_and_scikit_learn_only():
    assert class_named("HingeFeatures", CLASSES["features"]) is HingeFeatures
    assert class_named("sklearn.linear_model.Ridge", CLASSES["regression"]) is Ridge
    for wrong in (
        "subprocess.Popen",
        "sklearn.linear_model",
        "sklearn.datasets.load_iris",
        "",
        None,
        3,
        "check_records",
    ):
        with pytest.raises(ValueError, match="expected"):
            class_named(wrong, CLASSES["features"])


VALUES = st.recursive(
    st.booleans() | st.integers(-(2**62), 2**62) | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=8,
)


@given(VALUES)
def test_any_value_is_written_as_toml_reads_it(value):
    assert tomllib.loads(f"x = {toml(value)}")["x"] == value
