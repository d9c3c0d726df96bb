within FrictionFMUs.Laws;
partial model Stribeck "Coulomb, viscous and Stribeck friction"
  extends Interfaces.Rest;
  parameter Units.Force Fc(min = 0) = 1.0 "Coulomb friction";
  parameter Units.Force Fs(min = 0) = 1.5 "static friction (usually above Fc)";
  parameter Units.Damping Fv(min = 0) = 0.4 "viscous coefficient";
  parameter Units.Velocity vs(min = 1e-12) = 1e-3 "Stribeck velocity";
  parameter Real delta(min = 1e-3, max = 100) = 2.0 "Stribeck exponent";
  parameter Integer shape(min = 0, max = 1) = 0 "shape of the Stribeck curve; 0: exponential, 1: Lorentzian";
  parameter Units.Force offset = 0.0 "constant force, for example of an amplifier offset";
  parameter Boolean asymmetric = false "v < 0 uses the parameters with the suffix _neg";
  parameter Units.Force Fc_neg(min = 0) = 1.0 "Coulomb friction for v < 0";
  parameter Units.Force Fs_neg(min = 0) = 1.5 "static friction for v < 0";
  parameter Units.Damping Fv_neg(min = 0) = 0.4 "viscous coefficient for v < 0";
  parameter Units.Velocity vs_neg(min = 1e-12) = 1e-3 "Stribeck velocity for v < 0";
  parameter Real delta_neg(min = 1e-3, max = 100) = 2.0 "Stribeck exponent for v < 0";
protected
  Boolean negative = asymmetric and pre(direction) < 0;
  Real power, part "of Fs - Fc at this velocity";
equation
  high = offset + load*max(Fs, Fc);
  low = offset - load*(if asymmetric then max(Fs_neg, Fc_neg) else max(Fs, Fc));
  power = if negative then (abs(v)/vs_neg)^delta_neg else (abs(v)/vs)^delta;
  part = if shape == 1 then 1/(1 + power) else exp(-power);
  sliding = offset + (if negative then -load*(Fc_neg + (Fs_neg - Fc_neg)*part) + Fv_neg*v
    else load*(Fc + (Fs - Fc)*part)*pre(direction) + Fv*v);
  annotation(Documentation(info = "<html>
<pre>v /= 0:   F = load g(v) sign(v) + Fv v + offset
v  = 0:   |F - offset| &lt;= load max(Fs, Fc)
shape 0:  g(v) = Fc + (Fs - Fc) exp(-|v/vs|^delta)
shape 1:  g(v) = Fc + (Fs - Fc)/(1 + |v/vs|^delta)
load    = max(Fn, 0)/Fn0</pre>
<p>B. Armstrong-H&eacute;louvry, P. Dupont, C. Canudas de Wit: A survey of models, analysis tools and compensation
methods for the control of machines with friction, Automatica 30(7), 1994; shape 1 is from D. P. Hess, A. Soom, Journal
of Tribology 112(1), 1990.</p>
</html>"));
end Stribeck;
