"""A safety filter that gets a system into its safe set by a deadline and keeps it there.

- `build` makes FMUs from dicts or TOML files, `variables` lists what an FMU has, `check` judges a configuration, `plan`
  finds the plan from a start, `to_toml` writes a dict as a file has it.
- `run` runs a filter with its own model, without FMI.
- `simulate` couples a filter FMU with a plant FMU in FMPy, `promise` judges a barrier there, `plot` draws it, `to_pandas`
  makes a frame of it.
- In a dict a Python function may replace an expression: it is called once, with symbols.
- `campaign` makes many runs from drawn starts, on this machine or on a Dask cluster.
- `Filter` and `FilterBatch` are the same filter on NumPy arrays, without FMI. The module `punctual.gymnasium` wraps
  environments of Gymnasium with them.
- `run_cli` runs the command line, which is installed as `punctual` too.
"""

from ._campaign import campaign
from ._command import run_cli
from ._configuration import Configuration, to_toml
from ._enumerations import Assurance, Phase, Status
from ._error import Error, GuaranteeWarning
from ._fmu import Variable, build, check, variables
from ._punctual import BarrierReport, Filter, FilterBatch, Plan, Step, __version__
from ._pandas import to_pandas
from ._plan import plan
from ._plot import plot
from ._promise import Promise, promise
from ._run import Run, run
from ._simulate import simulate

__all__ = [
    "Assurance",
    "BarrierReport",
    "Configuration",
    "Error",
    "Filter",
    "FilterBatch",
    "GuaranteeWarning",
    "Phase",
    "Plan",
    "Promise",
    "Run",
    "Status",
    "Step",
    "Variable",
    "__version__",
    "build",
    "campaign",
    "check",
    "plan",
    "plot",
    "promise",
    "run",
    "run_cli",
    "simulate",
    "to_pandas",
    "to_toml",
    "variables",
]
