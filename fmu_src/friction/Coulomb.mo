within FrictionFMUs.Laws;
partial model Coulomb "Coulomb friction, which balances the other forces at rest"
  extends Interfaces.Rest;
  parameter Units.Force Fc(min = 0) = 1.0 "Coulomb friction at Fn0";
equation
  high = load*Fc;
  low = -high;
  sliding = load*Fc*pre(direction);
  annotation(Documentation(info = "<html>
<pre>v /= 0:  F = load Fc sign(v)
v  = 0:  |F| &lt;= load Fc
load   = max(Fn, 0)/Fn0</pre>
<p>C. A. Coulomb: Th&eacute;orie des machines simples, 1785.</p>
</html>"));
end Coulomb;
