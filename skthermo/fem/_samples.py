"""The result of sampling, in a file of its own because scikit-learn imports pandas."""

from sklearn.utils import Bunch

from skthermo._core.arrays import Array


class Samples(Bunch):
    """Parameters and the model's frequencies, with mode shapes where degrees of freedom were given."""

    theta: Array
    frequencies: Array
    shapes: Array
