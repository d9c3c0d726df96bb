within FrictionFMUs.Laws;
partial model ElastoPlastic "Elasto-plastic bristle friction without drift below break-away"
  extends Interfaces.Contact;
  parameter Units.Stiffness sigma0(min = 1e-9) = 1e5 "bristle stiffness";
  parameter Units.Damping sigma1(min = 0) = 316.22776601683796 "bristle damping";
  parameter Units.Damping sigma2(min = 0) = 0.4 "viscous coefficient";
  parameter Units.Force Fc(min = 1e-9) = 1.0 "Coulomb friction";
  parameter Units.Force Fs(min = 1e-9) = 1.5 "static friction (usually above Fc)";
  parameter Units.Velocity vs(min = 1e-12) = 1e-3 "Stribeck velocity";
  parameter Real delta(min = 1e-3, max = 100) = 2.0 "Stribeck exponent";
  parameter Units.Velocity v_d(min = 0) = 0.0 "speed at which the bristle damping decays; 0: constant damping";
  parameter Units.Length z_ba(min = 0) = 0.7e-5 "break-away deflection, below Fc/sigma0";
  Units.Length z(start = 0, fixed = true, nominal = 1e-5) "mean bristle deflection";
  Units.Length z_max "deflection of steady sliding";
  Units.Length along "deflection in the direction of motion";
  Real alpha "part of the motion in which the bristles slip";
equation
  assert(z_ba < min(Fc, Fs)/sigma0, "z_ba is not below Fc/sigma0 and Fs/sigma0; the FMU allows this");
  z_max = Interfaces.stribeck(v, Fc, Fs, vs, delta)/sigma0;
  along = if v < 0 then -z else z;
  alpha = if along >= z_max then 1 elseif along <= z_ba then 0
    else (1 + sin(Modelica.Constants.pi*(along - (z_max + z_ba)/2)/(z_max - z_ba)))/2;
  der(z) = v*(1 - alpha*along/z_max);
  F = (sigma0*z + (if v_d > 0 then sigma1*exp(-(v/v_d)^2) else sigma1)*der(z))*load + sigma2*v;
  annotation(Documentation(info = "<html>
<pre>dz/dt = v (1 - alpha z/z_ss(v)),   z_ss = sign(v) z_max,   z_max = S(v)/sigma0
S(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
alpha = 0 if sign(z) /= sign(v) or |z| &lt;= z_ba,   1 if |z| &gt;= z_max,   otherwise
        1/2 + 1/2 sin(pi (|z| - (z_max + z_ba)/2)/(z_max - z_ba))
F     = (sigma0 z + sigma1(v) dz/dt) load + sigma2 v,   load = max(Fn, 0)/Fn0
sigma1(v) = sigma1 exp(-(v/v_d)^2) if v_d &gt; 0, else sigma1</pre>
<p>z_ba must be below z_max(v) for all v.</p>
<p>P. Dupont, V. Hayward, B. Armstrong, F. Altpeter: Single state elastoplastic friction models, IEEE Transactions on
Automatic Control 47(5), 2002, with the exponent i = 1; sigma1(v) is from LuGre.</p>
</html>"));
end ElastoPlastic;
