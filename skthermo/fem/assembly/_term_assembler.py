"""Sums members' matrices into affine terms."""

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
import scipy.sparse

from skthermo.fem.elements import ByProperties, Dof

STIFFNESS = "stiffness"  # the whole stiffness of a group, whatever properties its members have
MASS = "mass"  # the whole mass of a group

Key = tuple[str, ...]


class TermAssembler:
    """Sums members' matrices, at the free ``dofs``, into one term for each combination of parameters and groups."""

    def __init__(self, dofs: Sequence[Dof]):
        self._index = {dof: i for i, dof in enumerate(dofs)}
        self._entries: dict[tuple[Key, frozenset[str]], list] = {}
        self._contents: dict[tuple[Key, frozenset[str]], list[tuple[Hashable, Key]]] = {}

    def add(
        self,
        member: Hashable,
        matrices: ByProperties,
        dofs: Sequence[Dof],
        bound: Mapping[str, str],
        damage: Mapping[str, str] | None = None,
    ) -> None:
        """Add one member's matrices, given the parameters and damage groups bound to its properties."""
        rows = np.array([self._index.get(dof, -1) for dof in dofs])
        free = np.flatnonzero(rows >= 0)
        square, kept = np.ix_(free, free), rows[free]
        grid = np.repeat(kept, len(kept)), np.tile(kept, len(kept))
        for properties, matrix in matrices.items():
            key = tuple(
                parameter
                for parameter, prop in bound.items()
                for _ in range(1 if prop in (STIFFNESS, MASS) else properties.count(prop))
            )
            groups = frozenset(g for g, prop in (damage or {}).items() if prop in (STIFFNESS, *properties))
            block = matrix[square].ravel()
            self._entries.setdefault((key, groups), []).append((block, *grid))
            self._contents.setdefault((key, groups), []).append((member, properties))

    def terms(self) -> list[tuple[Key, scipy.sparse.csr_array]]:
        """Parameters and matrix of every term."""
        terms = [(key, self._matrix(blocks)) for (key, _), blocks in self._entries.items()]
        return terms or [((), self._matrix([]))]

    def positions(self, group: str) -> list[int]:
        """Positions of the terms that a damage group scales."""
        return [i for i, (_, damage) in enumerate(self._entries) if group in damage]

    @property
    def contents(self) -> list[list[tuple[Hashable, Key]]]:
        """Members and properties whose matrices each term sums."""
        return list(self._contents.values())

    def _matrix(self, blocks: Sequence[tuple[np.ndarray, ...]]) -> scipy.sparse.csr_array:
        shape = (len(self._index), len(self._index))
        if not blocks:
            return scipy.sparse.csr_array(shape)
        values, rows, columns = (np.concatenate([b[i] for b in blocks]) for i in range(3))
        return scipy.sparse.csr_array((values, (rows, columns)), shape=shape)
