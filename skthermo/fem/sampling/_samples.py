"""What sampling returns; in a file of its own because scikit-learn imports pandas."""

from sklearn.utils import Bunch

from skthermo._arrays import Array


class Samples(Bunch):
    """Parameters, and what an FE model makes of them; ``shapes`` are there if they were asked for."""

    theta: Array
    frequencies: Array
    shapes: Array
