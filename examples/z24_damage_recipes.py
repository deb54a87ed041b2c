"""Parameters in place of frequencies, and identified damage; for ``plot_z24_damage.py``."""

from sklearn.compose import ColumnTransformer
from sklearn.pipeline import make_pipeline
from z24_recipes import FREQUENCIES, Records, bridge_model, chain, compensate

from skthermo.preprocessing import BiasAligner
from skthermo.studies import identify_damage
from skthermo.surrogate import PosteriorInverse, TemperatureMapper

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
    """Change of every parameter from the compensator's prediction, in percent: means of days."""
    residuals, _ = compensate(measured, TemperatureMapper(), targets=names)
    relative = (100 * r / (m[names] - r) for m, r in zip(measured, residuals, strict=True))
    return Records(*(frame.groupby(frame.index.floor("D")).mean() for frame in relative))


def identify(bridge):
    """Chain of all healthy records, as it stands for the bridge here, and the damage that explains its last month."""
    fem = chain(bridge_model()).fit(bridge.T, bridge.F)
    return fem, identify_damage(fem, bridge.T_damaged, bridge.F_damaged, random_state=0)
