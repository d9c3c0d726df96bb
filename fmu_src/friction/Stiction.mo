within FrictionFMUs.Laws;
partial model Stiction "Stiction, Coulomb and viscous friction"
  extends Interfaces.Rest;
  parameter Units.Force Fc(min = 0) = 1.0 "Coulomb friction at Fn0";
  parameter Units.Force Fs(min = 0) = 1.5 "static friction at Fn0 (usually above Fc)";
  parameter Units.Damping Fv(min = 0) = 0.4 "viscous coefficient";
equation
  high = load*max(Fs, Fc);
  low = -high;
  sliding = load*Fc*pre(direction) + Fv*v;
  annotation(Documentation(info = "<html>
<pre>v /= 0:  F = load Fc sign(v) + Fv v
v  = 0:  |F| &lt;= load max(Fs, Fc)
load   = max(Fn, 0)/Fn0</pre>
<p>A. Morin, 1833; in the form of H. Olsson and others: Friction models and friction compensation, European Journal of
Control 4(3), 1998, equation (4).</p>
</html>"));
end Stiction;
