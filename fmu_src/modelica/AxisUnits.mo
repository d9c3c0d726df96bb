within FrictionFMUs;
package AxisUnits "Units of forces and motions, or of torques and rotations"
  extends Modelica.Icons.TypesPackage;

  partial package Types "Types of the variables of a law"
    replaceable type Length = Real;
    replaceable type Velocity = Real;
    replaceable type Acceleration = Real;
    replaceable type Force = Real;
    replaceable type ForceRate = Real;
    replaceable type Stiffness = Real;
    replaceable type Damping = Real;
    replaceable type Mass = Real;
  end Types;

  package Translational "Forces and translational motion"
    extends Types(
      redeclare type Length = Real(unit = "m"),
      redeclare type Velocity = Real(unit = "m/s"),
      redeclare type Acceleration = Real(unit = "m/s2"),
      redeclare type Force = Real(unit = "N"),
      redeclare type ForceRate = Real(unit = "N/s"),
      redeclare type Stiffness = Real(unit = "N/m"),
      redeclare type Damping = Real(unit = "N.s/m"),
      redeclare type Mass = Real(unit = "kg"));
  end Translational;

  package Rotational "Torques and rotation"
    extends Types(
      redeclare type Length = Real(unit = "rad"),
      redeclare type Velocity = Real(unit = "rad/s"),
      redeclare type Acceleration = Real(unit = "rad/s2"),
      redeclare type Force = Real(unit = "N.m"),
      redeclare type ForceRate = Real(unit = "N.m/s"),
      redeclare type Stiffness = Real(unit = "N.m/rad"),
      redeclare type Damping = Real(unit = "N.m.s/rad"),
      redeclare type Mass = Real(unit = "kg.m2"));
  end Rotational;
end AxisUnits;
