package Modelica "What FrictionFMUs uses of the Modelica Standard Library 4, written for the tests"
  package Constants
    constant Real pi = 3.14159265358979323846;
  end Constants;
  package Icons
    partial class Package end Package;
    partial class ExamplesPackage end ExamplesPackage;
    partial class BasesPackage end BasesPackage;
    partial class InterfacesPackage end InterfacesPackage;
    partial class TypesPackage end TypesPackage;
    partial class Example end Example;
    partial class Function end Function;
  end Icons;

  package Blocks
    package Icons
      partial block DiscreteBlock end DiscreteBlock;
    end Icons;
    package Interfaces
      connector RealInput = input Real;
      connector RealOutput = output Real;
      connector BooleanInput = input Boolean;
      connector BooleanOutput = output Boolean;
    end Interfaces;
  end Blocks;

  package Mechanics
    package Translational
      package Interfaces
        connector Flange_a
          Real s;
          flow Real f;
        end Flange_a;
        connector Flange_b
          Real s;
          flow Real f;
        end Flange_b;
        partial model PartialCompliantWithRelativeStates
          parameter StateSelect stateSelect = StateSelect.prefer;
          parameter Real s_nominal = 1e-4;
          Real s_rel(start = 0, stateSelect = stateSelect, nominal = s_nominal);
          Real v_rel(start = 0, stateSelect = stateSelect);
          Real f;
          Flange_a flange_a;
          Flange_b flange_b;
        equation
          s_rel = flange_b.s - flange_a.s;
          v_rel = der(s_rel);
          flange_b.f = f;
          flange_a.f = -f;
        end PartialCompliantWithRelativeStates;
      end Interfaces;
      package Components
        model Fixed
          parameter Real s0 = 0;
          Interfaces.Flange_b flange;
        equation
          flange.s = s0;
        end Fixed;
        model Mass
          parameter Real m(min = 0);
          parameter Real L = 0;
          Real s, v(start = 0), a(start = 0);
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
        equation
          flange_a.s = s - L/2;
          flange_b.s = s + L/2;
          v = der(s);
          a = der(v);
          m*a = flange_a.f + flange_b.f;
        end Mass;
        model Spring
          parameter Real c, s_rel0 = 0;
          Real s_rel, f;
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
        equation
          s_rel = flange_b.s - flange_a.s;
          flange_b.f = f;
          flange_a.f = -f;
          f = c*(s_rel - s_rel0);
        end Spring;
      end Components;
      package Sources
        model ConstantSpeed
          parameter Real v_fixed;
          Real s;
          Interfaces.Flange_b flange;
        equation
          s = flange.s;
          der(s) = v_fixed;
        end ConstantSpeed;
        model Force
          Interfaces.Flange_b flange;
          Blocks.Interfaces.RealInput f;
        equation
          flange.f = -f;
        end Force;
      end Sources;
    end Translational;

    package Rotational
      package Interfaces
        connector Flange_a
          Real phi;
          flow Real tau;
        end Flange_a;
        connector Flange_b
          Real phi;
          flow Real tau;
        end Flange_b;
        partial model PartialCompliantWithRelativeStates
          Real phi_rel(start = 0, stateSelect = stateSelect, nominal = phi_nominal);
          Real w_rel(start = 0, stateSelect = stateSelect);
          Real a_rel(start = 0);
          Real tau;
          Flange_a flange_a;
          Flange_b flange_b;
          parameter Real phi_nominal = 1e-4;
          parameter StateSelect stateSelect = StateSelect.prefer;
        equation
          phi_rel = flange_b.phi - flange_a.phi;
          w_rel = der(phi_rel);
          a_rel = der(w_rel);
          flange_b.tau = tau;
          flange_a.tau = -tau;
        end PartialCompliantWithRelativeStates;
      end Interfaces;
      package Components
        model Fixed
          parameter Real phi0 = 0;
          Interfaces.Flange_b flange;
        equation
          flange.phi = phi0;
        end Fixed;
        model Inertia
          parameter Real J(min = 0);
          Real phi, w(start = 0), a(start = 0);
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
        equation
          phi = flange_a.phi;
          phi = flange_b.phi;
          w = der(phi);
          a = der(w);
          J*a = flange_a.tau + flange_b.tau;
        end Inertia;
        model Spring
          parameter Real c, phi_rel0 = 0;
          Real phi_rel, tau;
          Interfaces.Flange_a flange_a;
          Interfaces.Flange_b flange_b;
        equation
          phi_rel = flange_b.phi - flange_a.phi;
          flange_b.tau = tau;
          flange_a.tau = -tau;
          tau = c*(phi_rel - phi_rel0);
        end Spring;
      end Components;
      package Sources
        model ConstantSpeed
          parameter Real w_fixed;
          Real phi;
          Interfaces.Flange_b flange;
        equation
          phi = flange.phi;
          der(phi) = w_fixed;
        end ConstantSpeed;
        model Torque
          Interfaces.Flange_b flange;
          Blocks.Interfaces.RealInput tau;
        equation
          flange.tau = -tau;
        end Torque;
      end Sources;
    end Rotational;
  end Mechanics;
end Modelica;
