within FrictionFMUs.Laws;
partial model Viscous "Viscous friction, linear or a power of the velocity"
  extends Interfaces.Law;
  parameter Units.Damping Fv(min = 0) = 0.4 "viscous coefficient";
  parameter Real delta_v(min = 0, max = 100) = 1.0 "exponent of the velocity";
equation
  F = sign(v)*Fv*abs(v)^delta_v;
  annotation(Documentation(info = "<html>
<pre>F = Fv |v|^delta_v sign(v)</pre>
<p>O. Reynolds, 1886, for delta_v = 1; the power is equation (3) of H. Olsson and others: Friction models and friction
compensation, European Journal of Control 4(3), 1998.</p>
</html>"));
end Viscous;
