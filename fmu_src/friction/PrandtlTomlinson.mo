within FrictionFMUs.Laws;
partial model PrandtlTomlinson "Prandtl-Tomlinson model of a tip in a periodic potential, without temperature"
  extends Interfaces.Law;
  parameter Units.Mass m(min = 1e-40) = 1.0 "mass of the tip";
  parameter Real damping(unit = "1/s", min = 0) = 2.0 "gamma, damping rate";
  parameter Units.Stiffness k(min = 1e-30) = 1.0 "stiffness of the spring to the driver";
  parameter Real E0(unit = "J", min = 0) = 0.25 "height of the potential, from peak to peak";
  parameter Units.Length a(min = 1e-20) = 1.0 "period of the potential";
  Units.Length X(start = 0, fixed = true) "position of the driver";
  Units.Length x(start = 0, fixed = true) "position of the tip";
  Units.Velocity w(start = 0, fixed = true) "velocity of the tip";
equation
  der(X) = v;
  der(x) = w;
  m*der(w) + m*damping*w = F - Modelica.Constants.pi*E0/a*sin(2*Modelica.Constants.pi*x/a);
  F = k*(X - x);
  annotation(Documentation(info = "<html>
<pre>m x'' + m damping x' = k (X - x) - (pi E0/a) sin(2 pi x/a)
F = k (X - x),   dX/dt = v</pre>
<p>The FMU also has a temperature.</p>
<p>L. Prandtl: Ein Gedankenmodell zur kinetischen Theorie der festen K&ouml;rper, ZAMM 8, 1928; G. A. Tomlinson: A
molecular theory of friction, Philosophical Magazine 7, 1929.</p>
</html>"));
end PrandtlTomlinson;
