/* Rate error of a fibre-optic gyro from its temperature, @method@: @name@.
   Call coilwright_step once every @seconds@ s. It returns the rate error [deg/h] of the call @delay@ calls ago;
   subtract it from the rate of that call. valid = 0: no reading. */
#ifndef COILWRIGHT_COMPENSATION_H
#define COILWRIGHT_COMPENSATION_H

#define COILWRIGHT_DELAY @delay@

