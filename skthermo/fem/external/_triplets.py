"""Matrices that FE programs write as text, one entry a line."""

from __future__ import annotations

from os import PathLike

import numpy as np
import scipy.sparse

from skthermo._estimators.arguments import check_path
from skthermo._io import read_half


def read_triplets(path: str | PathLike) -> scipy.sparse.csc_array:
    """A symmetric matrix from a text of row, column and value for each entry of one half.

    CalculiX writes stiffness and mass in this form (``.sti`` and ``.mas``, with ``*FREQUENCY,
    SOLVER=MATRIXSTORAGE``), and so does SAP2000 (``.TXK`` and ``.TXM``).

    Parameters
    ----------
    path : str or path-like
        The file. Rows and columns are counted from 1. Lines before the first one that begins with a digit are a heading
        and left out.

    Returns
    -------
    csc_array of shape (n_dof, n_dof)
        The whole matrix, in the units of the program; ``n_dof`` is the largest row or column that occurs.

    Raises
    ------
    FileNotFoundError
        If the path does not exist.
    ValueError
        Names the file, if a line does not hold three numbers, rows or columns are not positive integers, there are
        entries on both sides of the diagonal, or the matrix would need too much memory (see `load_affine`).

    See Also
    --------
    load_affine : A model from a folder of such files.
    probe : A model from a program that writes such files, with one run for each parameter.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from skthermo.fem import read_triplets
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "tower.sti"
    ...     _ = file.write_text("1 1 800.0\\n1 2 -400.0\\n2 2 400.0\\n")
    ...     stiffness = read_triplets(file)
    >>> stiffness.toarray()
    array([[ 800., -400.],
           [-400.,  400.]])
    """
    file = check_path(path)
    if not file.exists():
        raise FileNotFoundError(f"{file} does not exist; expected a text of row, column and value in each line")
    if not file.is_file():
        raise ValueError(f"{file} is a folder or a device; expected a text of row, column and value in each line")
    matrix = read_half(file)
    if not np.isfinite(matrix.data).all():
        raise ValueError(f"{file} holds values that are not finite; expected finite ones")
    return matrix
