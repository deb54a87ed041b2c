inverse = InverseSurrogate(model, table_1, bounds=0.2, noise=0.01)
paper = DataInformedFEM(model, inverse=inverse, mapper=TemperatureMapper(table_1))
