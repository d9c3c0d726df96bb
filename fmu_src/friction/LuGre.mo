within FrictionFMUs.Laws;
partial model LuGre "LuGre bristle friction with Stribeck effect"
  extends Interfaces.Contact;
  parameter Units.Stiffness sigma0(min = 1e-9) = 1e5 "bristle stiffness";
  parameter Units.Damping sigma1(min = 0) = 316.22776601683796 "bristle damping";
  parameter Units.Damping sigma2(min = 0) = 0.4 "viscous coefficient";
  parameter Units.Force Fc(min = 1e-9) = 1.0 "Coulomb friction";
  parameter Units.Force Fs(min = 1e-9) = 1.5 "static friction (usually above Fc)";
  parameter Units.Velocity vs(min = 1e-12) = 1e-3 "Stribeck velocity";
  parameter Real delta(min = 1e-3, max = 100) = 2.0 "Stribeck exponent";
  parameter Units.Velocity v_d(min = 0) = 0.0 "speed at which the bristle damping decays; 0: constant damping";
  parameter Boolean asymmetric = false "v < 0 uses the parameters with the suffix _neg";
  parameter Units.Damping sigma2_neg(min = 0) = 0.4 "viscous coefficient for v < 0";
  parameter Units.Force Fc_neg(min = 1e-9) = 1.0 "Coulomb friction for v < 0";
  parameter Units.Force Fs_neg(min = 1e-9) = 1.5 "static friction for v < 0";
  parameter Units.Velocity vs_neg(min = 1e-12) = 1e-3 "Stribeck velocity for v < 0";
  parameter Real delta_neg(min = 1e-3, max = 100) = 2.0 "Stribeck exponent for v < 0";
  Units.Length z(start = 0, fixed = true, nominal = 1e-5) "mean bristle deflection";
  Units.Force g "Stribeck curve";
  Units.Damping damping "bristle damping at this speed";
equation
  g = if asymmetric and v < 0 then Interfaces.stribeck(v, Fc_neg, Fs_neg, vs_neg, delta_neg)
    else Interfaces.stribeck(v, Fc, Fs, vs, delta);
  der(z) = v - sigma0*abs(v)/g*z;
  damping = if v_d > 0 then sigma1*exp(-(v/v_d)^2) else sigma1;
  F = (sigma0*z + damping*der(z))*load + (if asymmetric and v < 0 then sigma2_neg else sigma2)*v;
  annotation(Documentation(info = "<html>
<pre>g(v)  = Fc + (Fs - Fc) exp(-|v/vs|^delta)
dz/dt = v - sigma0 |v| z/g(v)
F     = (sigma0 z + sigma1(v) dz/dt) load + sigma2 v,   load = max(Fn, 0)/Fn0
sigma1(v) = sigma1 exp(-(v/v_d)^2) if v_d &gt; 0, else sigma1</pre>
<p>A first model of an axis with presliding: one state describes stiffness at rest, break-away that depends on the rate
of the force, the Stribeck effect with lag, and stick-slip. z drifts under a constant force with vibration, and
reversal points are not remembered. If v jumps, F jumps by sigma1 times as much; v_d below 4 sqrt(2 e) Fc/sigma1 keeps
the contact passive.</p>
<p>C. Canudas de Wit, H. Olsson, K. J. &Aring;str&ouml;m, P. Lischinsky: A new model for control of systems with
friction, IEEE Transactions on Automatic Control 40(3), 1995, equations (2), (3) and (5); start values from its Table I.
sigma1(v) is equation (30) of H. Olsson and others, European Journal of Control 4(3), 1998.</p>
</html>"));
end LuGre;
