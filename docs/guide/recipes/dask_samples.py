import joblib
from dask.distributed import Client

from skthermo.fem import sample

with Client(n_workers=2, threads_per_worker=1, dashboard_address=None), joblib.parallel_config("dask"):
    drawn = sample(model, bounds=0.2, n_samples=1000, random_state=0)
