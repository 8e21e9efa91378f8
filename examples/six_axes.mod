MODULE Main
    PROC main()
        MoveAbsJ [[20,10,-10,15,40,25],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,tool0;
        TPWrite "arrived";
    ENDPROC
ENDMODULE
