"""What a compensator predicts in one weather is computed once for many records in it, with the same bits."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from skthermo._core import answers
from skthermo._core.answers import answer_once, answers_kept, content_of
from skthermo._core.warnings import without_warnings
from skthermo.detection import TemperatureCompensator
from tests.detection.compensated import MODES, X


class Counted(LinearRegression):
    """Counts its predictions."""

    n_predictions = 0

    def predict(self, X):
        type(self).n_predictions += 1
        return super().predict(X)


def in_many_states(seed, n_states=5):
    """Records with the same temperatures and the same gaps, but other frequencies."""
    random = np.random.default_rng(seed)
    factors = random.normal(1, 0.01, (n_states, len(MODES)))
    gaps = random.random((len(X), len(MODES))) < 0.1
    return [X.assign(**(X[MODES] * factor).mask(gaps)) for factor in factors]


@pytest.mark.parametrize("whiten", ["local", "global", None])
def test_states_in_one_weather_share_predictions_with_the_same_bits(whiten):
    compensator = TemperatureCompensator(Counted(), targets=MODES, whiten=whiten).fit(X)
    tables = in_many_states(0)
    alone = [compensator.transform(table) for table in tables]
    before = Counted.n_predictions
    with without_warnings(), answers_kept():
        together = [compensator.transform(table) for table in tables]
        assert Counted.n_predictions - before <= 2
        cooler = [compensator.transform(table.assign(T1=table["T1"] - 1)) for table in tables]
    for one, other in zip(alone, together, strict=True):
        pd.testing.assert_frame_equal(one, other, check_exact=True)
    for table, other in zip(tables, cooler, strict=True):
        one = compensator.transform(table.assign(T1=table["T1"] - 1))
        pd.testing.assert_frame_equal(one, other, check_exact=True)


def test_the_oldest_answers_are_forgotten_when_they_have_too_many_numbers(monkeypatch):
    monkeypatch.setattr(answers, "MOST_KEPT", 25)
    asked = []

    def question(who, number):
        return answer_once(who, (number,), 10, lambda: asked.append((who, number)) or number)

    with answers_kept():
        assert [question("a", n) for n in (1, 2, 1, 3, 3, 2, 1)] == [1, 2, 1, 3, 3, 2, 1]
    assert asked == [("a", 1), ("a", 2), ("a", 3), ("a", 1)]
    question("a", 1)
    assert len(asked) == 5  # outside, nothing is kept


def test_values_labels_and_types_are_the_content_and_not_what_pandas_caches_nor_the_layout():
    frame = X[MODES].copy()
    content = content_of(frame, "a")
    frame.index.resolution, frame.index.is_unique, frame.index.hour  # noqa: B018 -- which pandas keeps in the index
    values = frame.to_numpy()
    assert content_of(frame, "a") == content_of(frame.copy(), "a") == content
    assert content_of(np.asfortranarray(values)) == content_of(np.ascontiguousarray(values))
    shared = [values, values]
    assert content_of(*shared) == content_of(values, values.copy())
    others = [
        frame * (1 + 1e-15),
        frame[:-1],
        frame.rename(columns={MODES[0]: "other"}),
        frame.set_index(frame.index + pd.Timedelta(1, "ns")),
        frame.tz_localize("Europe/Zurich"),
        frame.reset_index(drop=True),
        frame.astype(np.float32),
        values,
    ]
    assert len({content, *(content_of(other, "a") for other in others)}) == 1 + len(others)
    assert content_of(values.T) != content_of(values) != content_of(values.ravel())
