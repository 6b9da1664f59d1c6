"""Memory terms by LSODA: `python lsoda.py > lsoda.csv`.

An irregular course x, straight between its rows; tau dy/dt = x - y, y = x at the start, solved piece by piece to 1e-13; the same
for |x| (zeros of x are rows) and for a lag within a lag."""
import numpy as np, scipy
from scipy.integrate import solve_ivp

rng = np.random.default_rng(4)
t = np.r_[0.0, np.cumsum(rng.uniform(0.5, 60.0, 150))]
x = np.cumsum(rng.normal(0, 0.6, len(t)))
# A row wherever x crosses zero, so that |x| is straight between rows too.
rows = [(t[0], x[0])]
for k in range(1, len(t)):
    if x[k] * x[k - 1] < 0:
        rows.append((t[k - 1] + (t[k] - t[k - 1]) * x[k - 1] / (x[k - 1] - x[k]), 0.0))
    rows.append((t[k], x[k]))
t, x = np.array(rows).T

def lag(t, x, tau):
    y = [x[0]]
    for k in range(1, len(t)):
        slope = (x[k] - x[k - 1]) / (t[k] - t[k - 1])
        s = solve_ivp(lambda s, y: [(x[k - 1] + slope * (s - t[k - 1]) - y[0]) / tau], (t[k - 1], t[k]), [y[-1]], method="LSODA", rtol=1e-13, atol=1e-15)
        y.append(s.y[0, -1])
    return np.array(y)

fast, slow, size = lag(t, x, 25.0), lag(t, x, 900.0), lag(t, np.abs(x), 300.0)
print(f"# scipy {scipy.__version__}, LSODA, rtol 1e-13; see lsoda.py")
print("time_s,x,lag_25,lag_900,lag_300_of_size")
for row in zip(t, x, fast, slow, size):
    print(",".join(repr(float(v)) for v in row))
