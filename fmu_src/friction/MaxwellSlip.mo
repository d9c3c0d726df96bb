within FrictionFMUs.Laws;
partial model MaxwellSlip "Maxwell slip: N elastic, perfectly plastic elements in parallel"
  extends Interfaces.Contact;
  parameter Integer N(min = 1) = 10 "number of elements";
  parameter Units.Stiffness k[N](each min = 0) =
    {28e3, 15e3, 10e3, 8e3, 6.5e3, 5.3e3, 4.3e3, 3.5e3, 2.8e3, 2.1e3} "stiffness of the element";
  parameter Units.Force W[N](each min = 0) = fill(0.1, N) "force at which the element slips";
  Units.Force Fi[N](each start = 0, each fixed = true, each nominal = 0.1) "force of the element at the normal force Fn0";
  Integer slips[N](each start = 0, each fixed = true) "direction in which the element slips; 0: it sticks";
equation
  for i in 1:N loop
    der(Fi[i]) = if pre(slips[i]) <> 0 then 0 else k[i]*v;
    slips[i] = if pre(slips[i]) <> 0 then (if pre(slips[i])*v < 0 then 0 else pre(slips[i]))
      elseif v > 0 and Fi[i] >= W[i] then 1 elseif v < 0 and -Fi[i] >= W[i] then -1 else 0;
  end for;
  F = sum(Fi)*load;
  annotation(Documentation(info = "<html>
<pre>dFi/dt = 0 if |Fi| = Wi and Fi v &gt; 0, else ki v,   i = 1 ... N
F      = (F1 + ... + FN) load,   load = max(Fn, 0)/Fn0</pre>
<p>W. D. Iwan: A distributed-element model for hysteresis and its steady-state dynamic response, Journal of Applied
Mechanics 33(4), 1966.</p>
</html>"));
end MaxwellSlip;
