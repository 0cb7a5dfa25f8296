; drain: theory §2.5. The power that a hand extracts at speed v against isotropic friction of at least
; (fd, fco) is at most D(F) = (|F| - fco)+^2 / (4 fd). The component of F along v is at most |F|
; (cauchy_schwarz).
(set-logic QF_NRA)
(declare-const fd Real)
(declare-const fco Real)
(declare-const td Real)  ; true viscous friction
(declare-const tc Real)  ; true Coulomb friction
(declare-const F Real)   ; |F|
(declare-const g Real)   ; component of F along v
(declare-const v Real)   ; |v|
(declare-const x Real)   ; (F - fco)+
(declare-const D Real)
(assert (and (> fd 0) (>= fco 0) (>= F 0) (>= v 0) (<= g F) (>= td 0) (>= tc 0)))
(assert (and (>= td fd) (>= tc fco)))  ; dropped in the twin
(assert (= x (ite (> F fco) (- F fco) 0)))
(assert (= (* 4 fd D) (* x x)))
(assert (>= (* (- x (* 2 fd v)) (- x (* 2 fd v))) 0))  ; hint
(assert (>= (* fd v (- (+ x fco) g)) 0))  ; hint
(assert (and (>= (* fd v (- tc fco)) 0) (>= (* fd v v (- td fd)) 0)))  ; hint
(assert (=> (> (- (* g v) (* tc v) (* td v v)) D) (> (* fd (- (* g v) (* tc v) (* td v v))) (* fd D))))  ; hint
(assert (> (- (* g v) (* tc v) (* td v v)) D))  ; negated conclusion
(check-sat)
