within FrictionFMUs.Laws;
partial model Tustin "Exponential decay from static to Coulomb friction, and viscous friction"
  extends Interfaces.Rest;
  parameter Units.Force Fc(min = 0) = 1.0 "Coulomb friction at Fn0";
  parameter Units.Force Fs(min = 0) = 1.5 "static friction at Fn0 (usually above Fc)";
  parameter Units.Damping Fv(min = 0) = 0.4 "viscous coefficient";
  parameter Units.Velocity vs(min = 1e-12) = 1e-3 "velocity scale of the decay of static friction";
equation
  high = load*max(Fs, Fc);
  low = -high;
  sliding = load*(Fc + (Fs - Fc)*exp(-abs(v)/vs))*pre(direction) + Fv*v;
  annotation(Documentation(info = "<html>
<pre>v /= 0:  F = load (Fc + (Fs - Fc) exp(-|v|/vs)) sign(v) + Fv v
v  = 0:  |F| &lt;= load max(Fs, Fc)
load   = max(Fn, 0)/Fn0</pre>
<p>A. Tustin: The effects of backlash and of speed-dependent friction on the stability of closed-cycle control systems,
Journal of the Institution of Electrical Engineers 94(2A), 1947.</p>
</html>"));
end Tustin;
