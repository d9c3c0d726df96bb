within FrictionFMUs.Laws;
partial model Dahl "Dahl friction, rate-independent presliding hysteresis"
  extends Interfaces.Contact;
  parameter Units.Stiffness sigma(min = 1e-9) = 1e5 "stiffness at zero force";
  parameter Units.Force Fc(min = 1e-9) = 1.0 "Coulomb friction";
  parameter Real n(min = 0, max = 100) = 1.0 "exponent of the softening, ductile above 1";
  Units.Length z(start = 0, fixed = true, nominal = 1e-5) "deflection of the contact";
  Real w "distance to the Coulomb level in the direction of motion, over Fc";
  Integer reached(start = 0, fixed = true) "direction in which the level is reached, for n < 1";
equation
  w = 1 - (if v < 0 then -1 else 1)*sigma*z/Fc;
  der(z) = if pre(reached) <> 0 then 0 else v*sign(w)*abs(w)^n;
  F = sigma*z*load;
  reached = if pre(reached) <> 0 then (if pre(reached)*v < 0 then 0 else pre(reached))
    elseif n >= 1 or w > 0 then 0 elseif v < 0 then -1 else 1;
  annotation(Documentation(info = "<html>
<pre>dz/dx = |w|^n sign(w),   w = 1 - sign(v) sigma z/Fc
F     = sigma z load,    load = max(Fn, 0)/Fn0</pre>
<p>For n &lt; 1, the Coulomb level is reached after a finite path and kept until a reversal.</p>
<p>P. R. Dahl: A solid friction model, The Aerospace Corporation TOR-158(3107-18), 1968, and: Solid friction damping of
mechanical vibrations, AIAA Journal 14(12), 1976.</p>
</html>"));
end Dahl;
