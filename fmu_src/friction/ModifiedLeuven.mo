within FrictionFMUs.Laws;
partial model ModifiedLeuven "Modified Leuven model: Maxwell slip hysteresis that relaxes to the Stribeck curve"
  extends Interfaces.Contact;
  parameter Integer N(min = 1) = 10 "number of elements";
  parameter Units.Stiffness k[N](each min = 0) =
    {28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3} "stiffness of the element";
  parameter Units.Force W[N](each min = 0) = fill(0.15, N) "force at which the element slips";
  parameter Real n(min = 0.1, max = 1e4) = 2.0 "sharpness of the transition to sliding";
  parameter Units.Damping sigma1(min = 0) = 316.22776601683796 "bristle damping";
  parameter Units.Damping sigma2(min = 0) = 0.4 "viscous coefficient";
  parameter Units.Force Fc(min = 1e-9) = 1.0 "Coulomb friction";
  parameter Units.Force Fs(min = 1e-9) = 1.5 "static friction (usually above Fc)";
  parameter Units.Velocity vs(min = 1e-12) = 1e-3 "Stribeck velocity";
  parameter Real delta(min = 1e-3, max = 100) = 2.0 "Stribeck exponent";
  Units.Length z(start = 0, fixed = true, nominal = 1e-5) "mean deflection";
  Units.Velocity w "rate of the deflection";
  Units.Force Fh "hysteresis force at the normal force Fn0";
  Units.Force Fi[N](each start = 0, each fixed = true, each nominal = 0.1) "force of the element at the normal force Fn0";
  Real r "hysteresis force over the Stribeck curve, in the direction of motion";
  Integer slips[N](each start = 0, each fixed = true) "direction in which the element slips; 0: it sticks";
equation
  Fh = sum(Fi);
  r = (if v < 0 then -Fh else Fh)/Interfaces.stribeck(v, Fc, Fs, vs, delta);
  w = v*(1 - sign(r)*abs(r)^n);
  der(z) = w;
  for i in 1:N loop
    der(Fi[i]) = if pre(slips[i]) <> 0 then 0 else k[i]*w;
    slips[i] = if pre(slips[i]) <> 0 then (if pre(slips[i])*w < 0 then 0 else pre(slips[i]))
      elseif w > 0 and Fi[i] >= W[i] then 1 elseif w < 0 and -Fi[i] >= W[i] then -1 else 0;
  end for;
  F = (Fh + sigma1*w)*load + sigma2*v;
  annotation(Documentation(info = "<html>
<pre>S(v)   = sign(v) (Fc + (Fs - Fc) exp(-|v/vs|^delta))
Fh     = F1 + ... + FN
dz/dt  = v (1 - sign(r) |r|^n),   r = Fh/S(v)
dFi/dt = 0 if |Fi| = Wi and Fi dz/dt &gt; 0, else ki dz/dt
F      = (Fh + sigma1 dz/dt) load + sigma2 v,   load = max(Fn, 0)/Fn0</pre>
<p>W1 + ... + WN must be at least Fs and Fc.</p>
<p>V. Lampaert, J. Swevers, F. Al-Bender: Modification of the Leuven integrated friction model structure, IEEE
Transactions on Automatic Control 47(4), 2002.</p>
</html>"));
end ModifiedLeuven;
