"""What was measured: shifts of frequencies and changes of mode shapes, and the records behind them."""

from skthermo.studies.identification.measured._compared import ComparedRecords
from skthermo.studies.identification.measured._measured_shapes import ShapeShift
from skthermo.studies.identification.measured._observe import Observation, observe
from skthermo.studies.identification.measured._shape_effects import ShapeEffects
from skthermo.studies.identification.measured._shift import Shift

__all__ = ["ComparedRecords", "Observation", "ShapeEffects", "ShapeShift", "Shift", "observe"]
