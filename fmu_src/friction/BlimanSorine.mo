within FrictionFMUs.Laws;
partial model BlimanSorine "Bliman-Sorine friction of order 1 or 2, linear in the path"
  extends Interfaces.Contact;
  parameter Integer order(min = 1, max = 2) = 2 "1: fast element only, 2: both";
  parameter Units.Force f1(min = 0) = 1.8 "level of the fast element";
  parameter Units.Force f2(min = 0) = 0.8 "level of the slow element, at most f1";
  parameter Real eta(min = 1e-9, max = 1) = 0.1 "ratio of the path constants, fast over slow element";
  parameter Units.Length eps(min = 1e-12) = 1e-3 "path constant";
  Units.Force F_fast(start = 0, fixed = true) "force of the fast element at Fn0";
  Units.Force F_slow(start = 0, fixed = true) "force of the slow element at Fn0; not used in order 1";
equation
  assert(order < 2 or f2 <= f1, "the parameters do not fulfil f2 <= f1");
  der(F_fast) = (f1*v - F_fast*abs(v))/(if order == 2 then eta*eps else eps);
  der(F_slow) = if order == 2 then (-f2*v - F_slow*abs(v))/eps else 0;
  F = (F_fast + F_slow)*load;
  annotation(Documentation(info = "<html>
<pre>ds = |v| dt
order 2:  dF_fast/ds = ( f1 sign(v) - F_fast)/(eta eps)
          dF_slow/ds = (-f2 sign(v) - F_slow)/eps
order 1:  dF_fast/ds = ( f1 sign(v) - F_fast)/eps,   F_slow = 0
F = (F_fast + F_slow) load,   load = max(Fn, 0)/Fn0</pre>
<p>P.-A. Bliman, M. Sorine: Easy-to-use realistic dry friction models for automatic control, European Control Conference,
Rome, 1995.</p>
</html>"));
end BlimanSorine;
