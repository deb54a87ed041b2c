from skthermo.datasets._truss import make_truss
