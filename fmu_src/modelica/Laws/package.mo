within FrictionFMUs;
package Laws "Equations of the friction models, for forces and for torques"
  extends Modelica.Icons.BasesPackage;
end Laws;
