within FrictionFMUs;
package Compensators "Sampled blocks that call the C code of the compensators"
  extends Modelica.Icons.Package;
end Compensators;
