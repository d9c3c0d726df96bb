within FrictionFMUs;
package Examples "Systems with friction"
  extends Modelica.Icons.ExamplesPackage;

  model StickSlip "A mass pulled by a spring whose other end moves slowly (LuGre 1995, figure 6)"
    extends Modelica.Icons.Example;
    Modelica.Mechanics.Translational.Components.Fixed ground;
    Translational.LuGre friction;
    Modelica.Mechanics.Translational.Components.Mass mass(
      m = 1, s(start = 0, fixed = true), v(start = 0, fixed = true));
    Modelica.Mechanics.Translational.Components.Spring spring(c = 2);
    Modelica.Mechanics.Translational.Sources.ConstantSpeed pull(v_fixed = 0.1, s(start = 0, fixed = true));
  equation
    connect(ground.flange, friction.flange_a);
    connect(friction.flange_b, mass.flange_a);
    connect(mass.flange_b, spring.flange_a);
    connect(spring.flange_b, pull.flange);
    annotation(experiment(StopTime = 20, Tolerance = 1e-8));
  end StickSlip;

  model DryStickSlip "The same on stiction: it sticks exactly"
    extends StickSlip(redeclare replaceable Translational.Stiction friction(Fv = 0));
  end DryStickSlip;
end Examples;
