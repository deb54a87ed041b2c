from sklearn.ensemble import StackingRegressor
from sklearn.linear_model import LinearRegression

model = model.with_modes([0]).with_parameters(["bottom"])  # one frequency, one parameter
first = DataInformedFEM(model, random_state=0)
stacked = StackingRegressor([("chain", first), ("lines", LinearRegression())]).fit(T, F["f1"])
predicted = stacked.predict(later.temperatures)
