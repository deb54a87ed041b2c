"""What the temperature mapper learns where the records do not determine all parameters."""

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import Beam, Spring, Structure, add_noise
from skthermo.metrics import mape
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

TRUSS = make_truss()
T = make_truss_campaign(random_state=0).temperatures


@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_predictions_are_free_of_the_shrinkage_of_the_prior():
    truth = 0.85 * np.exp(-0.002 * (T.to_numpy()[:, :1] - 10)) * np.ones(4)
    clean = TRUSS.frequencies(truth)
    inverse = PosteriorInverse(TRUSS, prior=0.05, noise=0.03)
    mapper = TemperatureMapper(LinearRegression())
    chain = DataInformedFEM(TRUSS, inverse=inverse, mapper=mapper, aligner="passthrough")
    chain.fit(T.to_numpy(), add_noise(clean, 0.03, random_state=0))
    biases = [(F / clean - 1).mean(axis=0) for F in (TRUSS.frequencies(chain.parameters_), chain.predict(T.to_numpy()))]
    assert biases[0].min() > 0.004
    assert np.abs(biases[1]).max() < 0.0035


def mirror_image():
    """A beam on two springs that are mirror images, each a parameter."""
    section = {"E": 33e9, "G": 14e9, "A": 5.0, "I_yy": 1.6, "I_zz": 20.0, "J": 3.0, "density": 2500.0}
    nodes = {i: (2.5 * i, 0.0, 0.0) for i in range(13)}
    members = {i: Beam(i, i + 1, **section) for i in range(12)}
    members |= {"left": Spring(4, "z", k=4e8), "right": Spring(8, "z", k=4e8)}
    members |= {"start": Spring(0, "z", k=6e8), "end": Spring(12, "z", k=6e8)}
    supports = dict.fromkeys(nodes, "y rx rz") | {0: "x y rx rz"}
    structure = Structure(nodes, members, supports, {"deck": range(12), "left": ["left"], "right": ["right"]})
    return structure.assemble(["deck", "left", "right"], n_modes=4, track=True)


def test_parameters_that_no_mode_tells_apart_stay_near_each_other():
    model = mirror_image()
    temperatures = 10 + 10 * np.random.default_rng(0).uniform(-1, 1, (200, 1))
    truth = np.exp((temperatures - 10) * [-0.004, -0.002, -0.002])
    measured = add_noise(model.frequencies(truth), 0.004, random_state=0)
    chain = DataInformedFEM(model, aligner="passthrough").fit(temperatures, measured)
    assert mape(model.frequencies(truth), chain.predict(temperatures)).max() < 0.2
    theta = chain.predict_parameters(temperatures)
    assert np.abs(np.log(theta[:, 1] / theta[:, 2])).mean() < 0.05
