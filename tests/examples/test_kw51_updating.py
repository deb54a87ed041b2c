"""The updating of KW51: modes followed, a false match refused."""

import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("matplotlib").use("Agg")

PATH = Path(__file__).parents[2] / "examples" / "plot_kw51_updating.py"
SPEC = importlib.util.spec_from_file_location(PATH.stem, PATH)
EXAMPLE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(EXAMPLE)


@pytest.fixture(scope="module")
def fits():
    settings = {"followed": (True, {}), "sorted": (False, {}), "wide": (True, {"E_bot": 0.3})}
    return {name: EXAMPLE.update(track, EXAMPLE.bounds(**wide), 3) for name, (track, wide) in settings.items()}


def mean_error(updater, when="after"):
    return updater.table_[f"error_{when}"].abs().mean()


def test_the_design_variables_are_those_of_the_model():
    model = EXAMPLE.kw51_structure().assemble(EXAMPLE.DESIGN, n_modes=6, track=True)
    theta = np.linspace(0.9, 1.1, 11)
    np.testing.assert_allclose(
        model.frequencies(theta), EXAMPLE.make_kw51(list(EXAMPLE.DESIGN)).frequencies(theta), rtol=1e-9
    )


def test_updating_brings_the_model_to_the_measured_frequencies(fits):
    followed, wide = fits["followed"][0], fits["wide"][0]
    assert mean_error(followed, "before") > 6
    assert mean_error(followed) < 2.5
    assert mean_error(wide) < 1.2
    assert (followed.starts_["optimum"] == 0).all()
    assert np.isinf(np.diag(followed.covariance_)).any()  # six frequencies cannot tell eleven parameters


def test_the_better_fit_of_sorted_modes_is_refused(fits):
    followed, messages = fits["followed"]
    false, refused = fits["sorted"]
    assert false.starts_["objective"].min() < followed.starts_["objective"].min()
    assert not messages
    assert len(refused) == 1
    assert "['f5', 'f6'] swap places" in refused[0]


def test_the_figure_is_drawn(tmp_path):
    ours = pd.DataFrame(EXAMPLE.PAPER_A3, index=EXAMPLE.MODES).T
    EXAMPLE.plot_a3(ours).savefig(tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 30_000
