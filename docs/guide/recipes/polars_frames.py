import polars

from skthermo.preprocessing import LagFeatures

T_polars, F_polars = (polars.DataFrame({c: table[c].to_numpy() for c in table}) for table in (T, F))
predicted = polars.DataFrame(fem.fit(T_polars, F_polars).predict(T_polars), schema=F_polars.columns)
lagged = LagFeatures(3).set_output(transform="polars").fit_transform(T_polars)
