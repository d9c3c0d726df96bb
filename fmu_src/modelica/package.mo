package FrictionFMUs "Friction models with flanges, and compensators; FMUs have the same names and equations"
  extends Modelica.Icons.Package;
  annotation(
    uses(Modelica(version = "4.0.0")),
    Documentation(info = "<html>
<p>Each friction model acts between two flanges, as a damper does: <code>Translational</code> has forces,
<code>Rotational</code> torques. Friction against a housing has <code>flange_a</code> at a <code>Fixed</code>.
<code>Laws</code> has the equations, each once for both. Parameters have the names, start values and ranges of the
FMUs.</p>
<p><code>F</code> is the friction that opposes the relative velocity <code>v</code> of <code>flange_b</code>. With
<code>useFn</code>, friction is proportional to the input <code>Fn</code>, the normal force, over <code>Fn0</code>.</p>
<p>Coulomb, Stiction, Tustin and Stribeck stick exactly: at rest, the relative acceleration is zero and F is the force
that this needs. Do not connect them to a prescribed motion with rests, in which this force is not determined.</p>
<p><code>Compensators</code> has sampled blocks, which call the C code of a controller. Their numbers are those of the
FMUs.</p>
</html>"));
end FrictionFMUs;
