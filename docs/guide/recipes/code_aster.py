from scipy.sparse import csr_array, save_npz


def save(name, matrix, numbering):
    values, rows, columns, n = matrix.EXTR_MATR(sparse=True)
    labels = numbering.getNodeAndComponentFromDOF()  # from version 16 on; before, from the numbering's table
    free = [i for i, label in enumerate(labels) if label not in held]
    save_npz(f"bridge/{name}.npz", csr_array((values, (rows, columns)), shape=(n, n))[free][:, free])
