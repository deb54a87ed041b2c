"""Affine models and matrices from files that FE programs write."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import add
from os import PathLike
from typing import Literal

import numpy as np
import scipy.sparse

from skthermo._core.arrays import Matrix, check_names, check_path
from skthermo._core.warnings import warn_each
from skthermo.fem._terms import Key
from skthermo.fem.affine import AffineModel
from skthermo.fem.external._differences import SAME_ENTRIES, TermPairs, doubtful_matrices, read_differences, relative
from skthermo.fem.external._files import MASS_OF, read_file, read_named_matrices
from skthermo.fem.external._texts import Labelled


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
        The whole matrix in the units of the program; the file may hold one half or all of it; ``n_dof`` is the largest
        row or column that occurs.

    Raises
    ------
    FileNotFoundError
        If the path does not exist, or is a folder.
    ValueError
        Names the file, and the line that does not hold three finite numbers; if rows or columns are not positive
        integers, an entry is given twice, entries are on both sides of the diagonal but not in pairs, or rows are more
        than twenty million and ten for each entry.

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
    if not file.is_file():
        raise FileNotFoundError(
            f"{file} does not exist as a file; expected a text of row, column and value in each line"
        )
    matrix = read_file(file, "lines of entries")
    if isinstance(matrix, Labelled):
        raise ValueError(f"{file} holds labels of nodes; expected row, column and value in each line, or load_affine")
    return matrix


Total = str | Literal[False] | None

MASS_NAMES = ("m", "m0", "mass", "maax", "maa", "mgg")
TOTAL_NAMES = ("k", "k0", "stiffness", "nominal", "kaax", "kaa", "kgg")


def load_affine(
    path: str | PathLike,
    *,
    stiffness: Collection[str] | Mapping[str, str | Key] | None = None,
    mass: str | None = None,
    total: Total = None,
    factor: float | Mapping[str, float] | None = None,
    n_modes: int | None = None,
    parameter_names: Sequence[str] | None = None,
    groups: Mapping[str, Sequence[tuple[str, ...] | int]] | None = None,
    track: bool = False,
) -> AffineModel:
    """An FE model from the stiffness terms and the mass matrix that another program has written.

    K(theta) is the sum of theta_j times the j-th stiffness matrix; each parameter has the name of its matrix.

    Parameters
    ----------
    path : str or path-like
        A file of several matrices, which have names in it, or a folder with one file for each matrix, whose stem is the
        name. Files are recognised by their content, see Notes. Matrices are dense or sparse; of a symmetric one, one
        half or all of it may be given.
    stiffness : collection of str, or mapping of str to str or tuple of str, optional
        Names of the matrices that are terms. A mapping also gives the parameters that multiply each matrix, as in
        `AffineModel`: ``()`` for none, ``("E", "A")`` for a product; several matrices may have the same parameter. By
        default every square matrix except the mass and the total is a term.
    mass : str, optional
        The mass matrix. By default the one called M, M0, mass, MAAX, MAA or MGG, in lower or upper case, or the mass
        of the exports.
    total : str or False, optional
        The whole nominal stiffness, with which the terms are compared. By default the matrix called K, K0, stiffness,
        nominal, KAAX, KAA or KGG, in lower or upper case, if there are other matrices and ``stiffness`` does not name
        it. False means that there is no total: the stiffness is the sum of the terms, whatever else the file holds.
    factor : float or mapping of str to float, optional
        Matrices are not terms but whole stiffness matrices, each with one parameter multiplied by this factor; the
        total is the one as built. `difference_terms` makes the terms and checks them.
    n_modes : int, optional
        How many of the lowest modes the model gives. By default six, or all if there are fewer.
    parameter_names : sequence of str, optional
        Columns of theta. By default in the order of the file; a folder is read in the order of its names,
        E_2 before E_10.
    groups : mapping of str to list of (tuple of str or int), optional
        Damage groups, as in `AffineModel`: by default each parameter is one.
    track : bool, default=False
        Whether a column follows its mode rather than its rank.

    Returns
    -------
    AffineModel
        With the matrices of the file as its terms.

    Raises
    ------
    FileNotFoundError
        If the path does not exist.
    ValueError
        Names the file, the line if it is a text, and the variable that is damaged, missing, of another size than the
        mass, or not finite; names the total if it holds less stiffness than the terms summed; or, with ``factor``,
        names the parameter whose matrix cannot be explained, as `difference_terms` does.

    See Also
    --------
    AffineModel : From matrices in memory.
    difference_terms : Terms from whole matrices in memory.
    probe : From a program that returns matrices.
    read_triplets : One matrix from the text of CalculiX or SAP2000.

    Notes
    -----
    :doc:`/guide/fe_programs` lists the files that are read, program by program, the names by which matrices of one job
    belong together, and the rules that decide the role of each matrix. Roles that were found and are doubtful, such as
    a total that is more than the sum of the terms, or a term proportional to the mass, give a warning.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from skthermo.fem import load_affine
    >>> k1, k2 = np.array([[400.0, 0], [0, 0]]), np.array([[400.0, -400], [-400, 400]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     np.savez(f"{folder}/tower.npz", K0=k1 + k2, k_base=k1, k_top=k2, M0=np.eye(2))
    ...     model = load_affine(f"{folder}/tower.npz", n_modes=2)
    >>> model.parameter_names
    ('k_base', 'k_top')
    >>> model.frequencies([[1.0, 1.0]]).round(3)
    array([[1.967, 5.15 ]])

    The same tower as Abaqus writes it, as built and with the stiffness of each spring doubled:

    >>> from pathlib import Path
    >>> text = "1,1, 1,1, {}\\n2,1, 1,1, {}\\n2,1, 2,1, {}\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     jobs = {"nominal": (800, -400, 400), "base": (1200, -400, 400), "top": (1200, -800, 800)}
    ...     for job, k in jobs.items():
    ...         _ = Path(folder, f"{job}_STIF1.mtx").write_text(text.format(*k))
    ...     _ = Path(folder, "nominal_MASS1.mtx").write_text(text.format(1, 0, 1))
    ...     model = load_affine(folder, factor=2.0, n_modes=2)
    >>> model.parameter_names, model.dofs
    (('base', 'top'), ((1, 1), (2, 1)))
    >>> model.frequencies([[1.0, 1.0]]).round(3)
    array([[1.967, 5.15 ]])
    """
    file = check_path(path)
    for what, one in (("mass", mass), ("total", None if total is False else total)):
        if one is not None and (not isinstance(one, str) or not one):
            raise ValueError(f"{what} is {one!r:.100}; expected the name of a matrix")
    keys = None if stiffness is None else _keys(stiffness)
    matrices, dofs = read_named_matrices(file, _used(keys, mass, total))
    try:
        pairs, mass_matrix, doubts = _roles(Exports(matrices), keys, mass, total, factor)
        mass_matrix, of_supports = _without_mass_of_held_rows(pairs, mass_matrix)
        doubts += of_supports
        model = AffineModel(
            pairs, mass_matrix, n_modes=n_modes, parameter_names=parameter_names, groups=groups, track=track, dofs=dofs
        )
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from error
    warn_each(doubtful_matrices([f"{file}: {doubt}" for doubt in doubts]))
    return model


def _without_mass_of_held_rows(pairs: TermPairs, mass: Matrix) -> tuple[Matrix, list[str]]:
    """The mass without the ones of rows that programs hold by ones on the diagonals of stiffness and mass, and a
    sentence about them: each would be a mode of 1 rad/s that no parameter moves."""
    matrices = [scipy.sparse.csc_array(matrix) for matrix in (mass, *(matrix for _, matrix in pairs))]
    is_alone = np.ones(mass.shape[0], dtype=bool)
    for matrix in matrices:
        coupling = scipy.sparse.coo_array(matrix)
        is_alone[coupling.col[(coupling.row != coupling.col) & (coupling.data != 0)]] = False
    diagonals = np.array([matrix.diagonal() for matrix in matrices])
    is_held = is_alone & (diagonals[0] == 1) & np.isin(diagonals, (0.0, 1.0)).all(axis=0) & diagonals[1:].any(axis=0)
    held = np.flatnonzero(is_held)
    if not len(held) or is_alone.all():
        return mass, []
    ones = scipy.sparse.diags_array(is_held.astype(float), format="csc")
    more = f" and {len(held) - 5} more" if len(held) > 5 else ""
    text = (
        f"rows {held[:5].tolist()}{more} hold ones on the diagonals of stiffness and mass alone, as supports do: their "
        "mass is left out. Export without these rows if they are free"
    )
    return matrices[0] - ones if scipy.sparse.issparse(mass) else mass - ones.toarray(), [text]


def _used(keys: Collection[str] | None, mass: str | None, total: Total) -> Callable[[str], bool]:
    """Whether a matrix of a folder has to be read, by its name."""
    usual = (MASS_NAMES if mass is None else ()) + (TOTAL_NAMES if total is None else ())

    def is_used(name: str) -> bool:
        is_named = keys is None or name in (*keys, mass, total)
        return is_named or name.lower() in usual or (mass is None and name.endswith(MASS_OF))

    return is_used


def _roles(
    exports: Exports,
    keys: dict[str, Key] | None,
    mass: str | None,
    total: Total,
    factor: float | Mapping[str, float] | None,
) -> tuple[TermPairs, Matrix, list[str]]:
    """Stiffness terms, mass, and doubts about the roles of matrices that nobody has named."""
    mass = mass or exports.mass_name()
    mass_matrix = exports.matrix(mass)
    found = exports.total_name(mass, keys, has_factor=factor is not None) if total is None else total
    doubts: list[str] = []
    if keys is None:
        springs = {name: one for name, one in exports.beside(mass, mass_matrix.shape).items() if name != found}
        if factor is None:
            springs, doubts = exports.terms_beside(mass, springs, has_total=found is not None)
        keys = {name: (name,) for name in springs}
    if not keys:
        raise ValueError(f"no stiffness matrix beside the mass {mass!r}; found {list(exports.matrices)}")
    terms = {name: exports.matrix(name, mass_matrix.shape) for name in keys}
    if factor is not None:
        if not found:
            raise ValueError(
                f"factor is given, but no matrix is called {', '.join(TOTAL_NAMES)}; expected the stiffness as built, "
                f"or total=..., one of {list(exports.matrices)}"
            )
        differences, doubts = read_differences(exports.matrix(found, mass_matrix.shape), terms, factor)
        return [(keys[name[0]] if name else (), term) for name, term in differences.items()], mass_matrix, doubts
    pairs = [(keys[name], term) for name, term in terms.items()]
    if found and (rest := exports.rest(found, terms)) is not None:
        pairs.append(((), rest))
        if total is None:
            doubts.append(
                f"{found!r} is more than the sum of {list(terms)}: the rest is used as a constant part of the "
                "stiffness. Confirm it by total=..., or give total=False if the terms are all, or name the terms by "
                "stiffness=[...]"
            )
    return pairs, mass_matrix, doubts


@dataclass(frozen=True)
class Exports:
    """Matrices by name that a program has written to a file or a folder, None for what holds no numbers."""

    matrices: Mapping[str, Matrix | None]

    @cached_property
    def square(self) -> dict[str, Matrix]:
        """The real square matrices; single numbers count only if there is nothing larger."""
        real = {name: one for name, one in self.matrices.items() if one is not None and not np.iscomplexobj(one)}
        square = {name: one for name, one in real.items() if one.shape[0] == one.shape[1] > 0}
        return {name: one for name, one in square.items() if one.shape[0] > 1} or square

    def matrix(self, name: str, shape: tuple[int, ...] = ()) -> Matrix:
        """A matrix of finite real numbers, of a shape if one is given."""
        if name not in self.matrices:
            raise ValueError(f"no variable {name!r}; found {list(self.matrices)}")
        matrix, what = self.matrices[name], f"variable {name!r}"
        if matrix is None:
            raise ValueError(f"{what} is not a matrix of real numbers")
        if np.iscomplexobj(matrix):
            raise ValueError(
                f"{what} is not a matrix of real numbers: its imaginary part is not zero; expected real ones, or "
                "stiffness=[...] that names the terms"
            )
        if not _is_finite(matrix):
            raise ValueError(f"{what} holds values that are not finite")
        if shape and matrix.shape != shape:
            expected = f"{shape} like the mass, or stiffness=[...] that names the terms"
            raise ValueError(f"{what} has shape {matrix.shape}; expected {expected}")
        return matrix

    def usual(self, names: Collection[str], usual: Collection[str], what: str) -> str | None:
        """The one name among the usual ones, if there is one."""
        found = [name for name in names if name.lower() in usual]
        if len(found) > 1:
            raise ValueError(f"{found} could each be the {what}; say {what}=...")
        return found[0] if found else None

    def mass_name(self) -> str:
        """The mass matrix: the one with a usual name, or the mass of all exports."""
        found = self.usual(self.square, MASS_NAMES, "mass")
        if found is not None:
            return found
        masses = [name for name in self.square if name.endswith(MASS_OF)]
        if not masses:
            raise ValueError(f"{self._no_mass()}; say mass=..., one of {[*self.square] or [*self.matrices]}")
        nominal = [name for name in masses if name.removesuffix(MASS_OF).lower() in TOTAL_NAMES]
        chosen = (nominal or masses)[0]
        reference = self.matrix(chosen)
        for name in masses:
            if not _same(self.matrix(name, reference.shape), reference, SAME_ENTRIES):
                both = f"{name.removesuffix(MASS_OF)!r} differs from that of {chosen.removesuffix(MASS_OF)!r}"
                raise ValueError(f"the mass of {both}; expected exports of the same mass, or mass=..., one of them")
        return chosen

    def _no_mass(self) -> str:
        """Text for the error that no matrix can be the mass."""
        for name, matrix in self.matrices.items():
            if name.lower() in MASS_NAMES:
                shape = "no matrix" if matrix is None else " x ".join(map(str, matrix.shape))
                is_complex = matrix is not None and np.iscomplexobj(matrix)
                return f"{name!r} is {shape}, {'complex' if is_complex else 'not square'}, and so not the mass"
        return f"no matrix is called {', '.join(MASS_NAMES)}"

    def total_name(self, mass: str, keys: Collection[str] | None, *, has_factor: bool) -> str | None:
        """The whole stiffness: a matrix with a usual name that is no term, beside others."""
        taken, shape = (*(keys or ()), mass), self.matrix(mass).shape
        others = {name: one for name, one in self.square.items() if name not in taken and not name.endswith(MASS_OF)}
        candidates = [name for name, one in others.items() if one.shape == shape and _is_finite(one)]
        found = self.usual(candidates, TOTAL_NAMES, "total") if keys or len(candidates) > 1 else None
        return self.usual(self.square, TOTAL_NAMES, "total") if found is None and has_factor else found

    def beside(self, mass: str, shape: tuple[int, ...]) -> dict[str, Matrix]:
        """All square matrices except masses; complex ones of the right shape are an error."""
        return {
            name: self.matrix(name, shape)
            for name, one in self.matrices.items()
            if one is not None and (name in self.square or one.shape == shape)
            if name != mass and not name.endswith(MASS_OF)
        }

    def terms_beside(
        self, mass: str, others: Mapping[str, Matrix], *, has_total: bool
    ) -> tuple[dict[str, Matrix], list[str]]:
        """The stiffness terms among the matrices beside mass and total, and doubts about these."""
        found = {name: scipy.sparse.csc_array(matrix) for name, matrix in others.items()}
        for name, term in found.items():
            if term.nnz and not (term + term.T).count_nonzero():
                raise ValueError(
                    f"variable {name!r} is skew-symmetric, as gyroscopic matrices are; expected symmetric ones, or "
                    "stiffness=[...] that names the terms"
                )
        mass_matrix, doubts = self.matrix(mass), list[str]()
        has_pattern = mass_matrix.shape[0] > 1
        like_mass = {name: _ratio(term, mass_matrix) for name, term in found.items()} if has_pattern else {}
        similar = {name: f"{ratio:.6g} times the mass {mass!r}" for name, ratio in like_mass.items() if ratio}
        springs = {name: term for name, term in found.items() if name not in similar}
        whole = reduce(add, springs.values(), 0 * mass_matrix)
        sums = [name for name, term in springs.items() if _same(term, whole - term, 1e-8)]
        if not has_total and len(springs) > 2 and len(sums) == 1:
            whole = whole - springs.pop(sums[0])
            del found[sums[0]]
            doubts.append(
                f"{sums[0]!r} is the sum of {list(springs)} and used as the total, not as a term. Confirm it by "
                f"total={sums[0]!r}, or name the terms by stiffness=[...]"
            )
        for name, term in springs.items() if len(springs) > 1 and has_pattern else ():
            if ratio := _ratio(term, whole - term):
                similar[name] = f"{ratio:.6g} times the sum of {[other for other in springs if other != name]}"
        doubts += [
            f"{name!r} is {what}, and used as a stiffness term. If it is none, frequencies are wrong. Name the terms "
            "by stiffness=[...]"
            for name, what in similar.items()
        ]
        return found, doubts

    def rest(self, total: str, terms: Mapping[str, Matrix]) -> Matrix | None:
        """The total minus all terms; None if nothing is left."""
        whole, summed = self.matrix(total, next(iter(terms.values())).shape), reduce(add, terms.values())
        if _same(summed, whole, SAME_ENTRIES):
            return None
        rest = scipy.sparse.csc_array(whole - summed)
        less = rest.diagonal() < -SAME_ENTRIES * np.abs(whole.diagonal())
        if less.any():
            row = int(np.argmax(less))
            raise ValueError(
                f"{total!r} is {whole.diagonal()[row]:.6g} at ({row}, {row}), less than the sum of {list(terms)}; "
                "expected a total of the stiffness, factor=2.0 if each of these is the whole with one modulus doubled, "
                "stiffness=... that says which matrices are terms, or total=False if none is the total"
            )
        return rest


def _is_finite(matrix: Matrix) -> bool:
    return bool(np.isfinite(matrix.data if scipy.sparse.issparse(matrix) else matrix).all())


def _ratio(term: Matrix, reference: Matrix) -> float:
    """The factor by which a term is a multiple of the reference; 0 if it is not."""
    reference = scipy.sparse.csc_array(reference)
    ratio = float((term * reference).sum() / max((reference * reference).sum(), np.finfo(float).tiny))
    return ratio if ratio and _same(term, ratio * reference, SAME_ENTRIES) else 0.0


def _same(matrix: Matrix, expected: Matrix, tolerance: float) -> bool:
    """Whether all differences are small relative to the diagonal."""
    return not (relative(scipy.sparse.coo_array(matrix - expected), expected.diagonal()) > tolerance).any()


def _keys(stiffness: Collection[str] | Mapping[str, str | Key]) -> dict[str, Key]:
    """The parameters that multiply each term."""
    names = [stiffness] if isinstance(stiffness, str) else stiffness
    names = names if isinstance(names, Mapping) else check_names(names, "stiffness")
    keys = names if isinstance(names, Mapping) else {name: name for name in names}
    return {name: (key,) if isinstance(key, str) else tuple(key) for name, key in keys.items()}
