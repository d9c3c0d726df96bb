within FrictionFMUs;
package Interfaces "Base classes of the laws"
  extends Modelica.Icons.InterfacesPackage;

  partial model Law "Friction as a function of the relative velocity"
    replaceable package Units = AxisUnits.Translational constrainedby AxisUnits.Types
      annotation(Dialog(tab = "Advanced"));
    Units.Velocity v "relative sliding velocity";
    Units.Force F "friction, opposes v";
    annotation(Icon(graphics = {
      Rectangle(extent = {{-90, 30}, {90, 0}}, fillColor = {192, 192, 192}, fillPattern = FillPattern.Forward),
      Rectangle(extent = {{-60, -10}, {60, -40}}, fillColor = {230, 230, 230}, fillPattern = FillPattern.Backward),
      Text(extent = {{-150, 80}, {150, 40}}, textColor = {0, 0, 255}, textString = "%name"),
      Text(extent = {{-150, -60}, {150, -90}}, textString = "%class")}));
  end Law;

  partial model Contact "Friction that is proportional to a normal force"
    extends Law;
    parameter Real Fn0(unit = "N", min = 1e-12) = 1.0 "normal force for which the parameters are valid";
    parameter Boolean useFn = false "true: Fn is an input; false: it is Fn0"
      annotation(Evaluate = true, choices(checkBox = true));
    Modelica.Blocks.Interfaces.RealInput Fn(unit = "N") if useFn "normal force"
      annotation(Placement(transformation(extent = {{-20, -20}, {20, 20}}, rotation = 270, origin = {0, 110})));
    Real load "normal force over Fn0; 0 if the contact opens";
  protected
    Modelica.Blocks.Interfaces.RealInput normal "normal force, also if it is not an input";
  equation
    assert(Fn0 >= 1e-12, "Fn0 = " + String(Fn0) + " is outside [1e-12, inf]");
    connect(Fn, normal);
    if not useFn then
      normal = Fn0;
    end if;
    load = max(normal, 0)/Fn0;
  end Contact;

  partial model Rest "Friction that holds a mass at rest exactly"
    extends Contact;
    Units.Acceleration a "relative acceleration";
    Units.Force low, high "range of friction at rest";
    Units.Force sliding "friction in motion";
    Integer direction(start = 0, fixed = true) "1 or -1: motion forward or backward; 0: rest";
    Boolean stuck "at rest and held by friction";
  equation
    a = der(v);
    0 = if pre(direction) == 0 then a else F - sliding;
    direction =
      if initial() and v > 0 then 1 elseif initial() and v < 0 then -1
      elseif pre(direction) == 0 then (if F > high then 1 elseif F < low then -1 else 0)
      elseif not pre(direction)*v < 0 or pre(direction)*a > 0 then pre(direction) else 0;
    stuck = direction == 0;
    annotation(Documentation(info = "<html>
<p>At rest, <code>der(v) = 0</code> determines F. Motion begins when F leaves the range from <code>low</code> to
<code>high</code>, and ends when v has changed its sign while the acceleration is also against the direction.</p>
</html>"));
  end Rest;

  function stribeck "Stribeck curve: friction in steady sliding without viscous friction"
    extends Modelica.Icons.Function;
    input Real v, Fc, Fs, vs, delta;
    output Real g;
  algorithm
    g := Fc + (Fs - Fc)*exp(-(abs(v)/vs)^delta);
    annotation(Inline = true);
  end stribeck;
end Interfaces;
