within FrictionFMUs.Laws;
partial model ResetIntegrator "Reset-integrator friction: a spring with a stop, stiffer while stuck"
  extends Interfaces.Contact;
  parameter Units.Stiffness sigma0(min = 1e-9) = 1e5 "stiffness while sliding";
  parameter Units.Length z0(min = 1e-15) = 1e-5 "largest deflection";
  parameter Real a(min = 0) = 0.5 "static over Coulomb friction, minus 1";
  parameter Units.Damping beta(min = 0) = 774.6 "damping while stuck";
  Units.Length z(start = 0, fixed = true, nominal = 1e-5) "deflection of the contact";
  Integer side(start = 0, fixed = true) "where the deflection is stopped; 0: free";
equation
  der(z) = if pre(side) <> 0 then 0 else v;
  F = ((if pre(side) <> 0 then 1 else 1 + a)*sigma0*z + beta*der(z))*load;
  side = if pre(side) <> 0 then (if pre(side)*v < 0 then 0 else pre(side))
    elseif v > 0 and z >= z0 then 1 elseif v < 0 and z <= -z0 then -1 else 0;
  annotation(Documentation(info = "<html>
<pre>dz/dt = 0  if v &gt; 0 and z &gt;= z0, or v &lt; 0 and z &lt;= -z0,  else v
F     = ((1 + a(z)) sigma0 z + beta dz/dt) load,   load = max(Fn, 0)/Fn0
a(z)  = a if |z| &lt; z0, else 0</pre>
<p>D. A. Haessig, B. Friedland: On the modeling and simulation of friction, ASME Journal of Dynamic Systems, Measurement,
and Control 113(3), 1991.</p>
</html>"));
end ResetIntegrator;
