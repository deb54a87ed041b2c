import keras
from scikeras.wrappers import KerasRegressor


def build(meta, hidden, dropout):
    """Dense layers with ReLU; ``dropout`` holds the rates after the input, after the first hidden layer, ..."""
    network = keras.Sequential([keras.Input((meta["n_features_in_"],))])
    for i, width in enumerate(hidden):
        for rate in dropout[i : i + 1]:
            network.add(keras.layers.Dropout(rate))
        network.add(keras.layers.Dense(width, activation="relu"))
    network.add(keras.layers.Dense(meta["n_outputs_"]))
    return network


adam = {"loss": "mse", "optimizer": "adam", "epochs": 1000, "verbose": 0}  # learning rate 0.001
table_1 = KerasRegressor(build, hidden=(128, 128, 64, 64, 32, 16), dropout=(0.05,), batch_size=128, **adam)
table_6 = KerasRegressor(build, hidden=(256, 128, 64, 32), dropout=(0.0, 0.2, 0.2), batch_size=256, **adam)
