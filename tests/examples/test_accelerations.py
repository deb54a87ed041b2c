"""Simulated accelerations have the frequencies, damping and variance of theory; pyOMA-2 finds the modes in them."""

import runpy

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from skthermo.datasets import make_truss, make_truss_campaign
from tests.examples.pages import EXAMPLES, recipes

simulation = recipes("accelerations")
DAMPING, FORCE, RATE = simulation.DAMPING, simulation.FORCE, simulation.RATE
SENSORS = np.linspace(0, 22, 8).astype(int)
STEP = 1 / RATE


@pytest.fixture(scope="module")
def year():
    return make_truss_campaign(samples_per_year=5, random_state=0)


@pytest.fixture(scope="module")
def modes(year):
    return simulation.modes_below(year.model, year.theta.iloc[0], RATE / 2)


@pytest.fixture(scope="module")
def accelerations(modes):
    return simulation.ambient_vibration(*modes, SENSORS, np.random.default_rng(0))


def impulse_response(frequency, damping=DAMPING, step=STEP, time_constants=10):
    n_samples = int(time_constants / (2 * np.pi * frequency * damping * step))
    return lfilter(*simulation.acceleration_filter(frequency, damping, step), np.eye(1, n_samples)[0])


def test_modes_are_those_of_the_truth_and_one_more(year, modes):
    frequencies, shapes = modes
    np.testing.assert_allclose(frequencies[:6], year.clean_frequencies.iloc[0], rtol=1e-9)
    assert len(frequencies) == 7
    _, mass = year.model.matrices(year.theta.iloc[0])
    np.testing.assert_allclose(shapes.T @ mass @ shapes, np.eye(7), atol=1e-9)


@pytest.mark.parametrize("frequency", [0.3, 95.0])
@pytest.mark.parametrize("damping", [0.001, 0.01, 0.2])
def test_the_filter_is_the_mode_with_forces_held(frequency, damping):
    numerator, denominator = simulation.acceleration_filter(frequency, damping)
    omega = 2 * np.pi * frequency
    held = cont2discrete(([1, 0, 0], [1, 2 * damping * omega, omega**2]), STEP, method="zoh")
    np.testing.assert_allclose(denominator, held[1], rtol=1e-9)
    np.testing.assert_allclose(numerator, held[0].ravel(), rtol=1e-6, atol=1e-9)
    pole = np.log(np.roots(denominator).astype(complex)) / STEP
    np.testing.assert_allclose(np.abs(pole), omega)
    np.testing.assert_allclose(-pole.real / np.abs(pole), damping)


@pytest.mark.parametrize("damping", [0.01, 0.03])
def test_the_stationary_variance_of_a_mode_is_that_of_white_noise(damping):
    """Displacements have the variance s dt / (4 xi w^3), velocities s dt / (4 xi w); both are older than the force."""
    phase = 0.02  # w dt
    response = impulse_response(phase / (2 * np.pi * STEP), damping)
    expected = 1 + phase * (1 + 4 * damping**2) / (4 * damping)
    np.testing.assert_allclose(response @ response, expected, rtol=1e-3)


def test_sensors_have_the_variance_and_noise_of_theory(modes, accelerations):
    responses = [impulse_response(f) for f in modes[0]]
    overlap = np.array([[a[: len(b)] @ b[: len(a)] for a in responses] for b in responses])
    participation = modes[1].T @ modes[1] * overlap
    expected = FORCE**2 * np.einsum("sm,mn,sn->s", modes[1][SENSORS], participation, modes[1][SENSORS])
    np.testing.assert_allclose(accelerations.var(axis=0), (1 + simulation.SENSOR_NOISE**2) * expected, rtol=0.05)
    random = (np.random.default_rng(1) for _ in range(2))
    clean, noisy = (
        simulation.ambient_vibration(*modes, SENSORS, next(random), n_samples=20_000, noise=n) for n in (0, 0.5)
    )
    np.testing.assert_allclose((noisy - clean).std(axis=0), 0.5 * clean.std(axis=0), rtol=0.02)


@pytest.mark.filterwarnings("ignore")  # of other packages, on import
def test_the_guides_code_finds_the_modes_of_a_record(modes, accelerations, monkeypatch):
    monkeypatch.setenv("PYOMA_LOG_LEVEL", "ERROR")
    monkeypatch.setenv("TQDM_DISABLE", "1")
    pytest.importorskip("pyoma2")
    recipe = runpy.run_path(str(EXAMPLES.parent / "docs" / "guide" / "recipes" / "poles_by_pyoma2.py"))
    found = recipe["track"]([accelerations[: len(accelerations) // 2]], RATE, make_truss(), SENSORS)
    np.testing.assert_allclose(found.frequencies.iloc[0], modes[0][:6], rtol=0.003)
    np.testing.assert_allclose(found.damping.iloc[0], DAMPING, rtol=0.5)
    assert (found.mac > 0.97).all(axis=None)
