"""
A new baseline after a retrofit: KW51
=====================================

The railway bridge KW51 was strengthened after half a year of monitoring. A monitor that knows the old bridge is in
alarm from the retrofit on, and rightly so. This page begins a new baseline three days after the end of the works: the
old records stay as prior knowledge of how the bridge follows the weather. The campaign is synthetic, with the length,
the gaps and the shifts of the measured one.

Run it with ``python examples/plot_new_baseline.py``; the figure goes to the folder ``figures``. It needs
:download:`page_recipes.py` beside it. The guide is :doc:`/guide/in_service`.
"""

import pandas as pd
from page_recipes import command_line, save_figures
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_kw51_campaign
from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.plotting import DamageIndexDisplay
from skthermo.preprocessing import HingeFeatures

options = command_line().parse_args()

# %%
# Before the works
# ----------------
# Every fourth hour is enough here. The baseline has seen winter and spring, and the monitor says so: nothing is
# asked for in the summer. One hard frost stands out, and raises the threshold.

campaign = make_kw51_campaign(random_state=0)
modes = list(campaign.frequencies)
records = campaign.temperatures.join(campaign.frequencies)["2018-11-22":].iloc[::4]
works_begin, works_end = (campaign.state.index[campaign.state == state][0] for state in ("during", "after"))

regression = make_pipeline(HingeFeatures(), Ridge())
detector = CompensatedDetector(MahalanobisDetector(), regression, targets=modes, window="2D")
monitor = Monitor(detector).fit(records[records.index < works_begin])
print(monitor.false_alarm_estimate_)

# %%
# During the works
# ----------------
# One event opens and stays open. The retrofit adds stiffness and mass, so that some frequencies rise and others fall.

monitor.update(records[(records.index >= works_begin) & (records.index < works_end)])
print(monitor.events_[["kind", "start", "end", "peak", "modes"]].to_string())

# %%
# Three days later
# ----------------
# :meth:`~skthermo.monitoring.Monitor.rebaseline` says which days the new baseline begins with, and closes the event.

after = records[records.index >= works_end]
soon = works_end + pd.Timedelta(days=3)
monitor.update(after[after.index < soon])
print(monitor.rebaseline(works_end).summary())

# %%
# A month later, a refit adds the new records, and says whether that is a gain. No record of the strengthened bridge is
# in alarm until January.

month = works_end + pd.Timedelta(days=30)
monitor.update(after[(after.index >= soon) & (after.index < month)])
print(monitor.refit().summary())
answers = monitor.update(after[after.index >= month])
print(answers["state"].value_counts().to_string())
print(monitor.summary())
DamageIndexDisplay.from_estimator(monitor)

save_figures(options.figures)
