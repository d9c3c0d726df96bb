within FrictionFMUs;
package Examples "Systems with friction"
  extends Modelica.Icons.ExamplesPackage;

  partial model PulledMass "A mass on friction, pulled by a spring whose other end moves slowly"
    extends Modelica.Icons.Example;
    Modelica.Mechanics.Translational.Components.Fixed ground
      annotation(Placement(transformation(extent = {{-70, -10}, {-50, 10}})));
    Modelica.Mechanics.Translational.Components.Mass mass(
      m = 1, s(start = 0, fixed = true), v(start = 0, fixed = true))
      annotation(Placement(transformation(extent = {{0, -10}, {20, 10}})));
    Modelica.Mechanics.Translational.Components.Spring spring(c = 2)
      annotation(Placement(transformation(extent = {{30, -10}, {50, 10}})));
    Modelica.Mechanics.Translational.Sources.ConstantSpeed pull(v_fixed = 0.1, s(start = 0, fixed = true))
      annotation(Placement(transformation(extent = {{80, -10}, {60, 10}})));
  equation
    connect(mass.flange_b, spring.flange_a);
    connect(spring.flange_b, pull.flange);
  end PulledMass;

  model StickSlip "Stick-slip on bristles, figure 6 of the LuGre paper"
    extends PulledMass;
    Translational.LuGre friction annotation(Placement(transformation(extent = {{-40, -10}, {-20, 10}})));
  equation
    connect(ground.flange, friction.flange_a);
    connect(friction.flange_b, mass.flange_a);
    annotation(experiment(StopTime = 20, Tolerance = 1e-8));
  end StickSlip;

  model DryStickSlip "Stick-slip on static friction: the mass sticks exactly"
    extends PulledMass;
    Translational.Stiction friction(Fv = 0)
      annotation(Placement(transformation(extent = {{-40, -10}, {-20, 10}})));
  equation
    connect(ground.flange, friction.flange_a);
    connect(friction.flange_b, mass.flange_a);
    annotation(experiment(StopTime = 20, Tolerance = 1e-8));
  end DryStickSlip;

  partial model Driven "A mass on friction with a force"
    extends Modelica.Icons.Example;
    Modelica.Mechanics.Translational.Components.Fixed ground
      annotation(Placement(transformation(extent = {{-70, -10}, {-50, 10}})));
    Modelica.Mechanics.Translational.Components.Mass mass(
      m = 1, s(start = 0, fixed = true), v(start = 0, fixed = true))
      annotation(Placement(transformation(extent = {{0, -10}, {20, 10}})));
    Modelica.Mechanics.Translational.Sources.Force force
      annotation(Placement(transformation(extent = {{60, -10}, {40, 10}})));
  equation
    connect(force.flange, mass.flange_b);
  end Driven;

  model ServoReversal "A position servo: the tracking error has peaks at reversals"
    extends Driven;
    Translational.LuGre friction annotation(Placement(transformation(extent = {{-40, -10}, {-20, 10}})));
    Real r = 0.01*(1 - cos(2*Modelica.Constants.pi*time)) "reference position [m]";
    Real e = r - mass.s "tracking error [m]";
  equation
    connect(ground.flange, friction.flange_a);
    connect(friction.flange_b, mass.flange_a);
    force.f = 4000*e + 90*(der(r) - mass.v);
    annotation(experiment(StopTime = 2, Tolerance = 1e-8));
  end ServoReversal;

  model FrictionCompensation "The same servo with feedforward of its friction: the peaks at reversals are gone"
    extends Driven;
    Translational.LuGre friction annotation(Placement(transformation(extent = {{-40, -10}, {-20, 10}})));
    Compensators.LuGreFeedforward feedforward annotation(Placement(transformation(extent = {{20, 30}, {40, 50}})));
    constant Real w = 2*Modelica.Constants.pi;
    Real r = 0.01*(1 - cos(w*time)) "reference position [m]";
    Real e = r - mass.s "tracking error [m]";
  equation
    connect(ground.flange, friction.flange_a);
    connect(friction.flange_b, mass.flange_a);
    feedforward.r = r;
    feedforward.rd = 0.01*w*sin(w*time);
    feedforward.rdd = 0.01*w^2*cos(w*time);
    force.f = 4000*e + 90*(feedforward.rd - mass.v) + feedforward.u;
    annotation(experiment(StopTime = 2, Tolerance = 1e-8));
  end FrictionCompensation;

  model DeadZone "Forces below static friction do not move the mass"
    extends Driven;
    Translational.Stribeck friction annotation(Placement(transformation(extent = {{-40, -10}, {-20, 10}})));
  equation
    connect(ground.flange, friction.flange_a);
    connect(friction.flange_b, mass.flange_a);
    force.f = 0.4*time*sin(2*Modelica.Constants.pi*time);
    annotation(experiment(StopTime = 6, Tolerance = 1e-8));
  end DeadZone;

  model NonlocalMemory "Inner hysteresis loops close and leave the outer loop as it was"
    extends Driven;
    Translational.GMS friction annotation(Placement(transformation(extent = {{-40, -10}, {-20, 10}})));
  equation
    connect(ground.flange, friction.flange_a);
    connect(friction.flange_b, mass.flange_a);
    force.f = 0.5*sin(time) + 0.35*sin(5*time) - 300*mass.v;
    annotation(experiment(StopTime = 20, Tolerance = 1e-8));
  end NonlocalMemory;
end Examples;
