within FrictionFMUs.Laws;
partial model LoadDependentDahl "Dahl friction proportional to the transmitted force, for strain-wave gears"
  extends Interfaces.Law;
  parameter Real mu_avg(min = 0) = 0.1 "mean of the friction coefficients of driving and back-driving";
  parameter Real mu_dif = 0.03 "half of the difference of driving and back-driving, at most mu_avg";
  parameter Units.Length eps(min = 1e-12) = 1e-3 "path constant after a reversal";
  parameter Units.Damping Fv(min = 0) = 0.4 "viscous coefficient";
  parameter Boolean useF_t = false "true: F_t is an input; false: it is 1"
    annotation(Evaluate = true, choices(checkBox = true));
  Modelica.Blocks.Interfaces.RealInput F_t if useF_t "transmitted force, positive if it drives towards positive v"
    annotation(Placement(transformation(extent = {{-20, -20}, {20, 20}}, rotation = 270, origin = {0, 110})));
  Real z(start = 0, fixed = true) "deflection over the deflection of steady sliding";
protected
  Modelica.Blocks.Interfaces.RealInput transmitted "transmitted force, also if it is not an input";
equation
  assert(abs(mu_dif) <= mu_avg, "the parameters do not fulfil |mu_dif| <= mu_avg");
  connect(F_t, transmitted);
  if not useF_t then
    transmitted = 1;
  end if;
  der(z) = (v - abs(v)*z)/eps;
  F = mu_avg*abs(transmitted)*z + mu_dif*transmitted*z^2 + Fv*v;
  annotation(Documentation(info = "<html>
<pre>dz/dt = (v - |v| z)/eps
F     = mu_avg |F_t| z + mu_dif F_t z^2 + Fv v</pre>
<p>The user andyabateagility in issue 3528 of google-deepmind/mujoco, GitHub, 2026, without Fv v.</p>
</html>"));
end LoadDependentDahl;
