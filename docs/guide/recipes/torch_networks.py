from itertools import pairwise

import numpy as np
import torch
from skorch import NeuralNetRegressor
from skorch.callbacks import LRScheduler


def build(n_inputs=1, n_outputs=1, hidden=(128, 128, 64, 64, 32, 16), dropout=(0.05,)):
    """Dense layers with ReLU; ``dropout`` holds the rates after the input, after the first hidden layer, ..."""
    layers = []
    for i, (width, next_width) in enumerate(pairwise([n_inputs, *hidden])):
        layers += [torch.nn.Dropout(rate) for rate in dropout[i : i + 1]]
        layers += [torch.nn.Linear(width, next_width), torch.nn.ReLU()]
    return torch.nn.Sequential(*layers, torch.nn.Linear(hidden[-1], n_outputs))


class DropoutNetwork(NeuralNetRegressor):
    def fit(self, X, y, **options):
        X, y = np.float32(X), np.float32(y).reshape(len(y), -1)
        self.set_params(module__n_inputs=X.shape[1], module__n_outputs=y.shape[1])
        return super().fit(X, y, **options)

    def predict(self, X):
        return super().predict(np.float32(X))


adam = {"optimizer": torch.optim.Adam, "lr": 0.001, "max_epochs": 1000, "train_split": None, "verbose": 0}
schedule = LRScheduler("StepLR", step_size=250, gamma=0.5)
table_1 = DropoutNetwork(build, batch_size=128, callbacks=[schedule], **adam)
table_6 = DropoutNetwork(
    build, module__hidden=(256, 128, 64, 32), module__dropout=(0.0, 0.2, 0.2), batch_size=256, **adam
)
