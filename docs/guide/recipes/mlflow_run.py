import joblib
import mlflow

from skthermo.metrics import mape

mlflow.set_tracking_uri("sqlite:///mlflow.db")
with mlflow.start_run() as run:
    mlflow.log_params({name: str(value)[:250] for name, value in fem.get_params().items()})
    fem.fit(T, F)
    errors = mape(later.frequencies, fem.predict(later.temperatures))
    mlflow.log_metrics({f"mape_{mode}": error for mode, error in zip(F.columns, errors)})
    joblib.dump(fem, "fem.joblib")
    mlflow.log_artifact("fem.joblib")
