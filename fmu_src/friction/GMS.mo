within FrictionFMUs.Laws;
partial model GMS "Generalised Maxwell slip: N elements attracted to the Stribeck curve in slip"
  extends Interfaces.Contact;
  parameter Integer N(min = 1) = 10 "number of elements";
  parameter Units.Stiffness k[N](each min = 0) =
    {28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3} "stiffness of the element";
  parameter Real alpha[N](each min = 0) = fill(0.1, N) "weight of the element in the Stribeck level";
  parameter Units.ForceRate C(min = 0) = 100.0 "attraction to the Stribeck level";
  parameter Units.ForceRate Ci[N](each min = -1) = fill(-1, N) "attraction of the element; negative: C";
  parameter Units.Damping sigma(min = 0) = 0.0 "damping of each element";
  parameter Units.Damping sigma2(min = 0) = 0.4 "viscous coefficient";
  parameter Units.Force Fc(min = 1e-9) = 1.0 "Coulomb friction";
  parameter Units.Force Fs(min = 1e-9) = 1.5 "static friction (usually above Fc)";
  parameter Units.Velocity vs(min = 1e-12) = 1e-3 "Stribeck velocity";
  parameter Real delta(min = 1e-3, max = 100) = 2.0 "Stribeck exponent";
  Units.Force Fi[N](each start = 0, each fixed = true, each nominal = 0.1) "force of the element at the normal force Fn0";
  Units.Velocity rate[N] "rate of the deflection of the element";
  Units.Force S "Stribeck curve";
  Integer slips[N](each start = 0, each fixed = true) "direction in which the element slips; 0: it sticks";
equation
  S = Interfaces.stribeck(v, Fc, Fs, vs, delta);
  for i in 1:N loop
    der(Fi[i]) = if pre(slips[i]) == 0 then k[i]*v
      else (if Ci[i] < 0 then C else Ci[i])*(pre(slips[i])*alpha[i]/sum(alpha) - Fi[i]/S);
    rate[i] = if pre(slips[i]) == 0 then v elseif k[i] > 0 then der(Fi[i])/k[i] else 0;
    slips[i] = if pre(slips[i]) <> 0 then (if pre(slips[i])*v > 0 then pre(slips[i]) else 0)
      elseif v > 0 and Fi[i] >= alpha[i]/sum(alpha)*S then 1
      elseif v < 0 and -Fi[i] >= alpha[i]/sum(alpha)*S then -1 else 0;
  end for;
  F = (sum(Fi) + sigma*sum(rate))*load + sigma2*v;
  annotation(Documentation(info = "<html>
<pre>S(v)   = Fc + (Fs - Fc) exp(-|v/vs|^delta)
stick:   dFi/dt = ki v                                      until sign(v) Fi &gt;= alpha_i S(v)
slip:    dFi/dt = sign(v) Ci (alpha_i - sign(v) Fi/S(v))    until v = 0
F      = (sum Fi + sigma sum dzi/dt) load + sigma2 v,       load = max(Fn, 0)/Fn0
dzi/dt = v in stick, (dFi/dt)/ki in slip</pre>
<p>The weights alpha_i are divided by their sum, so that friction in steady sliding is S(v). C, or Ci of an element, is
the rate at which a slipping element approaches the curve: the frictional lag has the time constant S/C.</p>
<p>A model for precise positioning with reversals: presliding hysteresis with memory of all reversal points, Stribeck
effect and lag, without drift. F has a kink where an element begins to slip.</p>
<p>F. Al-Bender, V. Lampaert, J. Swevers: The generalized Maxwell-slip model: a novel model for friction simulation and
compensation, IEEE Transactions on Automatic Control 50(11), 2005, in its force form. The start values of the elements
are specific to this library; those of the curve are from Table I of the LuGre paper.</p>
</html>"));
end GMS;
