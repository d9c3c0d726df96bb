"""A joint in SDFormat."""

from functools import partial

from friction_fmus.export.targets import Target
from friction_fmus.export.targets.urdf import write

TARGET = Target("a joint in SDFormat (Gazebo)", "axis", partial(write, file="joint.sdf", turning="revolute"))
