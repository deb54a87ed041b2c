import joblib
from ray.util.joblib import register_ray

from skthermo.fem import sample

register_ray()
with joblib.parallel_config("ray", n_jobs=2):
    drawn = sample(model, bounds=0.2, n_samples=1000, random_state=0)
