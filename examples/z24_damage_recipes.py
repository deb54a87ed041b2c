"""Parameters in place of frequencies, and identified damage; for ``plot_z24_damage.py``."""

from sklearn.compose import ColumnTransformer
from sklearn.pipeline import make_pipeline
from z24_recipes import FREQUENCIES, bridge_model, chain, residuals

from skthermo.preprocessing import BiasAligner
from skthermo.studies import identify_damage
from skthermo.surrogate import PosteriorInverse

FROST = 2.0  # pavement below this, in degrees Celsius, may hold ice


def in_parameters(records):
    """The records with multipliers of the FE model in place of frequencies, and the names of these."""
    model = bridge_model()
    inverse = PosteriorInverse(model, prior=0.2)  # as far as damage may go; weather moves less
    others = [column for column in records.baseline if column not in FREQUENCIES]
    to_parameters = ColumnTransformer(
        [
            ("temperatures", "passthrough", others),
            ("parameters", make_pipeline(BiasAligner(model, method="scale"), inverse), FREQUENCIES),
        ],
        verbose_feature_names_out=False,
    ).set_output(transform="pandas")
    return records.each(to_parameters.fit(records.baseline).transform), list(model.parameter_names)


def changes(measured, names):
    """Change of every parameter from what the weather explains, in percent: means of days."""
    return residuals(measured, names).each(lambda frame: frame.groupby(frame.index.floor("D")).mean())


def identify(bridge):
    """Chain of all healthy records, as it stands for the bridge here, and the damage that explains its last month."""
    fem = chain(bridge_model()).fit(bridge.T, bridge.F)
    return fem, identify_damage(fem, bridge.T_damaged, bridge.F_damaged, random_state=0)
