import numpy as np
from scipy.special import logsumexp


def weigh(curves, d, C, scales, prior, subsets, logs, severity=0.2, model_error=0.05):
    n = curves.changes.shape[0]
    s = np.linspace(0.0, 0.95, 77)[1:]
    tables = np.stack([curves(np.full((1, n), 0.0))[0][0] * 0 + _one(curves, s, c) for c in range(n)])  # n, S, obs
    size = 1e-3
    out = []
    w = s[1] - s[0]
    for sub, lp in zip(subsets, logs):
        if len(sub) == 0:
            pred = np.zeros((1, len(d)))
            lw = np.zeros(1)
            am = np.zeros((1, 0))
        else:
            lws = []
            for c in sub:
                sc = severity * scales[c]
                l = -0.5 * (s / sc) ** 2
                lws.append(l - logsumexp(l))
            if len(sub) == 1:
                pred, lw, am = tables[sub[0]], lws[0], s[:, None]
            else:
                k = slice(None, None, 2)
                a, b = tables[sub[0]][k], tables[sub[1]][k]
                pred = (a[:, None] + b[None]).reshape(-1, len(d))
                lw = (lws[0][k][:, None] + lws[1][k][None]).ravel()
                lw -= logsumexp(lw)
                am = np.stack(np.meshgrid(s[k], s[k], indexing="ij"), -1).reshape(-1, 2)
        var = np.diag(C) + (model_error * pred) ** 2
        ll = -0.5 * ((d - pred) ** 2 / var + np.log(var)).sum(1)
        tot = ll + lw
        ev = logsumexp(tot)
        p = np.exp(tot - ev)
        out.append((ev + lp, p @ am))
    return np.array([o[0] for o in out]), [o[1] for o in out]


def _one(curves, s, c):
    am = np.zeros((len(s), curves.changes.shape[0]))
    am[:, c] = s
    return curves(am)[0]
