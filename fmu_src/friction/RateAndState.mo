within FrictionFMUs.Laws;
partial model RateAndState "Rate-and-state friction, aging or slip law, regular at rest"
  extends Interfaces.Contact;
  parameter Real mu0(min = 0) = 0.6 "coefficient of friction in steady sliding at V0";
  parameter Real a(min = 0) = 0.01 "direct effect of the slip rate";
  parameter Real b(min = 0) = 0.015 "effect of the contact age";
  parameter Units.Length Dc(min = 1e-12) = 1e-5 "slip distance that renews the contacts";
  parameter Units.Velocity V0(min = 1e-15) = 1e-6 "reference velocity";
  parameter Units.Force sigma_n(min = 0) = 1.0 "normal force at Fn = Fn0; in the rotational twin, times the radius";
  parameter Boolean law = false "law of the contact age; false: aging law, true: slip law";
  Real theta(unit = "s", start = 10, fixed = true) "age of the contacts; positive";
  Real mu "coefficient of friction, with the sign of v";
protected
  Real x, worn "slip distances per contact age";
equation
  x = abs(v)/(2*V0)*exp((mu0 + b*log(V0*theta/Dc))/a);
  mu = sign(v)*a*log(x + sqrt(x^2 + 1));
  worn = abs(v)*theta/Dc;
  der(theta) = if not law then 1 - worn elseif noEvent(worn > 0) then -worn*log(worn) else 0;
  F = load*sigma_n*mu;
  annotation(Documentation(info = "<html>
<pre>mu = a asinh(v/(2 V0) exp((mu0 + b ln(V0 theta/Dc))/a))
F  = load sigma_n mu,   load = max(Fn, 0)/Fn0
aging law:  dtheta/dt = 1 - |v| theta/Dc
slip law:   dtheta/dt = -(|v| theta/Dc) ln(|v| theta/Dc)</pre>
<p>J. H. Dieterich: Modeling of rock friction 1, Journal of Geophysical Research 84(B5), 1979; A. Ruina: Slip instability
and state variable friction laws, Journal of Geophysical Research 88(B12), 1983; J. R. Rice, Y. Ben-Zion, PNAS 93,
1996, for the form that is regular at v = 0.</p>
</html>"));
end RateAndState;
