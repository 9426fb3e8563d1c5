"""The response that the hand feels: transmitted admittance and impedance, and the worst case
over the aliases."""
