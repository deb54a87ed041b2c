"""The file of settings makes what Python makes, and mistakes in it are named with their line."""

import re
import shutil

import pytest
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo.detection import CompensatedDetector, DirectionalDetector, MahalanobisDetector
from skthermo.monitoring import Monitor, load_monitor
from skthermo.preprocessing import ExponentialMeans, HingeFeatures
from tests.commands.folders import run


def whole(old, text):
    """A text that is to be replaced; a setting with its default, whatever that is."""
    return re.search(rf"^{re.escape(old)}.*$", text, re.MULTILINE)[0] if old.endswith("=") else old


@pytest.fixture(scope="module")
def proposed(fitted):
    return (fitted / "monitor.toml").read_text(encoding="utf-8")


@pytest.fixture
def fit(tmp_path, proposed):
    """The command ``fit`` after a change of the proposed settings."""

    def fitting(old="", new=""):
        file, old = tmp_path / "monitor.toml", whole(old, proposed)
        assert not old or proposed.count(old) == 1
        file.write_text(proposed.replace(old, new) if old else proposed + new, encoding="utf-8")
        return run("fit", file)

    return fitting


def by_python(detector, *steps, compensated=None, **parameters):
    regression = make_pipeline(*steps)
    targets = ["f1", "f2", "f3", "f4", "f5", "f6"]
    parameters = {"false_alarms_per_year": 1.0, "watch_per_year": 12.0, "units": "Hz", "random_state": 0} | parameters
    return Monitor(CompensatedDetector(detector, regression, targets=targets, **(compensated or {})), **parameters)


@pytest.mark.nightly
def test_the_file_makes_what_python_makes(fitted, tmp_path):
    made = load_monitor(fitted / "monitor.joblib")
    assert repr(made) == repr(by_python(DirectionalDetector(), HingeFeatures(), Ridge()))
    folder = shutil.copytree(fitted, tmp_path / "bridge")
    file = folder / "monitor.toml"
    text = file.read_text(encoding="utf-8")
    changes = {
        'class = "DirectionalDetector"': 'class = "MahalanobisDetector"',
        "# window = ...": 'window = "5D"',
        "# regimes =": 'regimes = "none"',
        '[[features]]\nclass = "H': '[[features]]\nclass = "ExponentialMeans"\nhalf_lives = ["2D", "20D"]\n\n'
        '[[features]]\nclass = "H',
        "# persistence =": 'persistence = [4, 6]\nmax_delay = "3D"',
    }
    for beginning, new in changes.items():
        old = whole(beginning, text)
        assert text.count(old) == 1
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")
    done = run("fit", file, "--replace")
    assert done.code == 0, done.err
    steps = ExponentialMeans(half_lives=["2D", "20D"]), HingeFeatures(), Ridge()
    given = {"compensated": {"window": "5D", "regimes": None}, "persistence": [4, 6], "max_delay": "3D"}
    assert repr(load_monitor(folder / "monitor.joblib")) == repr(by_python(MahalanobisDetector(), *steps, **given))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("# persistence =", "persistance = 3", "did you mean 'persistence'"),
        ("[monitor]\n", "[montior]\n", "did you mean 'monitor'"),
        ("# persistence =", 'persistence = "three"', "persistence"),
        ("# persistence =", "persistence = [4, 3]", "such as (4, 6)"),
        ("false_alarms_per_year = 1.0", "false_alarms_per_year = -1", "false_alarms_per_year"),
        ('class = "DirectionalDetector"', 'class = "MahalanobisDetecter"', "did you mean 'MahalanobisDetector'"),
        ('class = "sklearn.linear_model.Ridge"', 'class = "os.system"', "scikit-learn"),
        ('class = "sklearn.linear_model.Ridge"', "alpha = 2", "class"),
        ("# n_knots =", "n_knots = -4", "n_knots"),
        ('# separator = ","', "separator = 3", "expected str"),
        ("# time_zone = ...", 'time_zone = "Europe/Brussel"', "Europe/Brussels"),
        ("# missing = []", 'missing = ["x"]', "list of float"),
        ('temperatures = ["T1", "T2", "T3"]', 'temperatures = ["T1", "T2", "f1"]', "f1"),
        ('temperatures = ["T1", "T2", "T3"]', "temperatures = []", "temperatures"),
        ('temperatures = ["T1", "T2", "T3"]', "", "lacks temperatures"),
        ("# convert = {}", 'convert = {T1 = "R"}', "convert"),
        ("[compensator]\n", '[compensator]\nestimator = "Ridge"\n', "estimator"),
        ("[[features]]", "[features]", "[[features]]"),
        ("[regression]", "[[regression]]", "[regression], once"),
        ('# page = "status.html"', 'page = "../status.html"', "in the folder of the settings"),
        ('# transitions = "transitions.jsonl"', 'transitions = "/tmp/t.jsonl"', "in the folder of the settings"),
    ],
)  # fmt: skip
def test_mistakes_are_named_with_their_line(fit, proposed, old, new, expected):
    done, old = fit(old, new), whole(old, proposed)
    assert (done.code, "monitor.toml" in done.err) == (3, True)
    assert expected in done.err
    first = proposed[: proposed.index(old)].count("\n") + 1
    line = int(re.search(r"line (\d+)", done.err)[1])
    wrong = new.strip().split("\n")[-1] if new else ""
    changed = proposed.replace(old, new).splitlines()
    assert line == first or changed[line - 1].startswith("[") or changed[line - 1] == wrong


def test_what_is_no_toml_and_no_file_is_an_error(fit, tmp_path):
    done = fit(new="\nname = \n")
    assert (done.code, "line" in done.err) == (3, True)
    assert "init" in run("fit", tmp_path / "no.toml").err
    done = run("status", tmp_path / "no.toml", "--json")
    assert (done.code, len(done.json["bridges"][0]["errors"])) == (3, 1)
