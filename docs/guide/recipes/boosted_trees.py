from lightgbm import LGBMRegressor
from xgboost import XGBRegressor

boosted = XGBRegressor(n_estimators=100, max_depth=3, learning_rate=0.1, n_jobs=1)
light = LGBMRegressor(n_estimators=100, num_leaves=8, learning_rate=0.1, n_jobs=1, verbose=-1)
chains = {
    name: clone(fem).set_params(inverse__regressor=trees, mapper=TemperatureMapper(trees)).fit(T, F)
    for name, trees in {"XGBoost": boosted, "LightGBM": light}.items()
}
