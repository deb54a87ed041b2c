"""Mirror images of a symmetric bridge, whose chain has drifted out of symmetry."""

import numpy as np
import pytest

from skthermo.fem import Beam, Spring, Structure, add_noise
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM, PosteriorInverse

SECTION = {"E": 33e9, "G": 14e9, "A": 5.0, "I_yy": 1.6, "I_zz": 20.0, "J": 3.0, "density": 2500.0}


def bridge():
    """Three spans of 20, 30 and 20 m on springs."""
    nodes = {i: (5.0 * i, 0.0, 0.0) for i in range(15)}
    members = {i: Beam(i, i + 1, **SECTION) for i in range(14)}
    members |= {"p1": Spring(4, "z", k=4e8), "p2": Spring(10, "z", k=4e8)}
    members |= {"b0": Spring(0, "z", k=6e8), "b3": Spring(14, "z", k=6e8)}
    groups = {"deck": range(14), "pier_1": ["p1"], "pier_2": ["p2"]}
    supports = dict.fromkeys(nodes, "y rx rz") | {0: "x y rx rz"}
    return Structure(nodes, members, supports, groups).assemble(["deck", "pier_1", "pier_2"], n_modes=4)


@pytest.mark.nightly
def test_mirror_images_are_named_and_share_the_probability():
    model = bridge()
    T = 10 + 10 * np.random.default_rng(0).uniform(-1, 1, (300, 1))
    theta = np.exp((T - 10) * [-0.004, -0.003, -0.003])
    fem = DataInformedFEM(model, inverse=PosteriorInverse(noise=0.004), random_state=0)
    fem.fit(T, add_noise(model.frequencies(theta), 0.004, random_state=0))
    records = add_noise(model.damaged({"pier_2": 0.2}).frequencies(theta), 0.004, random_state=1)
    with pytest.warns(UserWarning, match="pier_1 and pier_2.*indistinguishable-groups"):
        found = identify_damage(fem, T, records, random_state=0)
    assert found.separability.indistinguishable == [("pier_1", "pier_2")]
    assert found.probabilities.p_value < 0.01
    assert found.probabilities.damage > 0.99
    alone = found.explanations["probability"]
    assert 0.3 < alone["pier_2"] / alone["pier_1"] < 3
    assert (found.table.loc[["pier_1", "pier_2"], "standard_error"] > 0.05).all()
    assert found.estimates.loc[("pier_2", "pier_2"), "severity"] == pytest.approx(0.2, abs=0.02)
    assert (found.table["ci_low"] == 0).all()
    assert found.table.loc["pier_2", "ci_high"] > 0.18
